// Pointers, keys and the buttons to walk, as changes of the view.
const HELD = {  // what a held key does a second: to the right, down and ahead
  ArrowLeft: [-1, 0, "turn"], ArrowRight: [1, 0, "turn"], ArrowUp: [0, -1, "turn"], ArrowDown: [0, 1, "turn"],
  w: [0, 0, 1], s: [0, 0, -1], a: [-1, 0, 0], d: [1, 0, 0], q: [0, 1, 0], e: [0, -1, 0],
};
const STEP = 0.1;  // of a click, in seconds

// stop() ends what plays, change() tells that the view changed, and press(key, isRepeated) does what
// else a key means and returns whether it means anything. Returns move(seconds), which moves the view
// by all that is held and returns whether anything is.
const bindInput = (canvas, walk, navigation, { stop, change, press }) => {
  bindPointers(canvas, navigation, stop, change);
  const keys = bindKeys(canvas, navigation, { stop, change, press });
  const touched = bindButtons(walk, navigation, stop, change);
  return (seconds) => {
    const held = new Set([...keys, ...touched]);
    for (const key of held) {
      const [x, y, z] = HELD[key];
      if (z === "turn") navigation.steer(x * seconds, y * seconds);
      else navigation.walk(x * seconds, y * seconds, z * seconds);
    }
    return held.size > 0;
  };
};

// One turns, with Shift or the right button it slides; two slide and zoom.
const bindPointers = (canvas, navigation, stop, change) => {
  const pointers = new Map();
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("pointerdown", (event) => {
    stop();
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    try { canvas.setPointerCapture(event.pointerId); } catch { /* it was released meanwhile */ }
  });
  for (const kind of ["pointerup", "pointercancel"]) canvas.addEventListener(kind, (event) => pointers.delete(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY], tall = canvas.clientHeight || 1;
    const by = [(now[0] - before[0]) / tall, (now[1] - before[1]) / tall];
    pointers.set(event.pointerId, now);
    const others = [...pointers].filter(([id]) => id !== event.pointerId);
    if (others.length) {
      const apart = ([x, y]) => Math.hypot(x - others[0][1][0], y - others[0][1][1]) || 1;
      navigation.zoomBy(apart(now) / apart(before));
      navigation.slide(by[0] / 2, by[1] / 2);
    } else if (event.shiftKey || event.buttons & 2) navigation.slide(...by);
    else navigation.turn(...by);
    change();
  });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    navigation.zoomBy(Math.exp(-event.deltaY * (event.deltaMode ? 0.03 : 0.0015)));
    change();
  }, { passive: false });
};

// Keys, on the canvas. Returns those of HELD that are down.
const bindKeys = (canvas, navigation, { stop, change, press }) => {
  const keys = new Set(), named = (event) => (event.key.length === 1 ? event.key.toLowerCase() : event.key);
  canvas.addEventListener("keydown", (event) => {
    if (event.metaKey) keys.clear();  // macOS tells of no key that is released meanwhile
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const key = named(event);
    if (HELD[key]) { stop(); keys.add(key); }
    else if ("+=-".includes(key)) { navigation.zoomBy(key === "-" ? 0.9 : 1 / 0.9); change(); }
    else if (!press(key, event.repeat)) return;
    event.preventDefault();
  });
  canvas.addEventListener("keyup", (event) => keys.delete(named(event)));
  canvas.addEventListener("blur", () => keys.clear());
  return keys;
};

// The same by buttons, for fingers. Screen readers click without a pointer. Returns the keys of those that are held.
const bindButtons = (walk, navigation, stop, change) => {
  const touched = new Set();
  for (const button of walk.children) {
    const key = button.dataset.key, release = () => touched.delete(key);
    button.addEventListener("pointerdown", () => { stop(); touched.add(key); });
    for (const kind of ["pointerup", "pointercancel", "pointerleave"]) button.addEventListener(kind, release);
    button.addEventListener("contextmenu", (event) => event.preventDefault());  // of a long touch
    button.addEventListener("click", (event) => {
      if (event.detail) return;
      navigation.walk(...HELD[key].map((v) => v * STEP));
      change();
    });
  }
  return touched;
};
