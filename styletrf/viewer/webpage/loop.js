// When what is drawn: coarsely while the view moves, then finer, then the mean of several pictures.
const SCALES = [1, 0.75, 0.5, 0.375, 0.25, 0.1875, 0.125];
const MOVING_MS = 33, PART_MS = 60, SETTLED_MS = 180, SMOOTHING_MS = 6000, MOST_PICTURES = 16;
const FIRST_PIXEL_MS = 1e-2;  // as without a graphics card, so that the first picture is quick

const halton = (k, base) => {
  let value = 0;
  for (let share = 1 / base; k > 0; k = Math.floor(k / base), share /= base) value += share * (k % base);
  return value;
};

// next(now) changes the view and returns whether it did; picture(width, height) is what to draw;
// tell reports a picture that is shown.
const makeLoop = (canvas, renderer, { next, picture, tell }) => {
  const pass = { count: 0, row: 0, scale: 1, isMoving: true };
  let perPixelMs = FIRST_PIXEL_MS, isBusy = false, isStale = true, isReplaced = false, changed = performance.now();
  const waiting = [];
  let hasShown = null;
  const isShown = new Promise((go) => { hasShown = go; });  // a first picture

  const change = () => {
    changed = performance.now();
    isStale = true;
    waiting.splice(0).forEach((go) => go(false));
  };
  const restart = (isMoving) => {
    const most = MOVING_MS / perPixelMs / (canvas.width * canvas.height);
    const scale = isMoving ? SCALES.find((s) => s * s <= most) ?? SCALES.at(-1) : 1;
    Object.assign(pass, { count: 0, row: 0, scale, isMoving });
    isStale = false;
  };
  const size = () => [canvas.width, canvas.height].map((n) => Math.max(1, Math.round(n * pass.scale)));
  const mostPictures = () => {
    if (pass.isMoving || !renderer.addsUp) return 1;
    const [width, height] = size();
    return Math.min(MOST_PICTURES, Math.max(1, Math.floor(SMOOTHING_MS / (perPixelMs * width * height))));
  };
  const step = async () => {
    const [width, height] = size(), first = pass.row, k = pass.count;
    const rows = pass.isMoving ? height : Math.max(8, Math.floor(PART_MS / perPixelMs / width));
    const end = Math.min(height, first + rows);
    const offset = k ? [halton(k, 2) - 0.5, halton(k, 3) - 0.5] : [0, 0];
    const begun = performance.now();
    isReplaced = false;
    renderer.draw({ ...picture(width, height), width, height, first, end, offset, count: k + 1 });
    await renderer.fence();
    if (isReplaced) return;  // the next frame begins again
    perPixelMs += 0.5 * (Math.max(0.5, performance.now() - begun) / (width * (end - first)) - perPixelMs);
    pass.row = end % height;
    if (pass.row) return;
    renderer.present();
    pass.count++;
    hasShown();
    if (isWhole()) waiting.splice(0).forEach((go) => go(true));
    tell({ width, height, ms: perPixelMs * width * height, count: pass.count });
  };
  // Returns what act() returns, which draws something else than the picture, such as a thumbnail.
  const aside = (act) => {
    isReplaced = true;
    change();
    return act();
  };
  const frame = (now) => {
    requestAnimationFrame(frame);
    if (isBusy) return;
    if (next(now)) change();
    const isMoving = performance.now() - changed < SETTLED_MS;
    if (isStale || isMoving !== pass.isMoving) restart(isMoving);
    if (pass.row === 0 && pass.count >= mostPictures()) return;  // never between parts of a picture
    isBusy = true;
    step().catch(refuse).finally(() => { isBusy = false; });
  };
  const isAtRest = () => !isStale && !pass.isMoving && pass.count > 0;  // what is shown is a mean
  const isWhole = () => isAtRest() && pass.row === 0;  // and so is all that is drawn
  const isFinished = () => !isBusy && isWhole() && pass.count >= mostPictures();
  // Resolves to true when a whole picture at rest is drawn, and to false if the view is not at rest.
  const whole = () => new Promise((go) => (isAtRest() && (isBusy || pass.row) ? waiting.push(go) : go(isAtRest())));
  const start = () => { requestAnimationFrame(frame); return isShown; };
  return { change, aside, isSettled: () => !isBusy && isAtRest(), isFinished, whole, start };
};
