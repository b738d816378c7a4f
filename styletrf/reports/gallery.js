const gallery = document.querySelector(".gallery"), announcement = document.querySelector(".announcement");
const tiles = [...document.querySelectorAll(".tile")];
const buttons = [...document.querySelectorAll(".sort button")];
const playAll = document.querySelector(".play-all");
const isCalm = matchMedia("(prefers-reduced-motion: reduce)").matches;
const canHover = matchMedia("(hover: hover)").matches;
document.body.classList.add("live");

const names = new Intl.Collator();
const byName = (a, b, ...keys) => keys.reduce((order, key) => order || names.compare(a.dataset[key], b.dataset[key]), 0);
const score = (tile, key) => JSON.parse(tile.dataset.scores)[key];
const byScore = (a, b, key, sign) => {  // what has none comes last, either way round
  const [x, y] = [score(a, key), score(b, key)];
  if (x === undefined || y === undefined) return (x === undefined) - (y === undefined);
  return sign * (x - y);
};
const order = (key, sign) => (a, b) => {
  if (key === "scene") return sign * byName(a, b, "scene") || byName(a, b, "style");
  if (key === "style") return sign * byName(a, b, "style") || byName(a, b, "scene");
  return byScore(a, b, key, sign) || byName(a, b, "scene", "style");
};
const sortBy = (button) => {
  const isAgain = button.getAttribute("aria-pressed") === "true";
  const isReversed = isAgain && button.dataset.reversed === undefined;
  for (const each of buttons) {
    each.setAttribute("aria-pressed", each === button);
    delete each.dataset.reversed;
  }
  if (isReversed) button.dataset.reversed = "";
  const key = button.dataset.key;
  const sign = (button.dataset.best === "highest") === isReversed ? 1 : -1;
  gallery.append(...tiles.sort(order(key, sign)));
  for (const row of gallery.querySelectorAll("dl div"))
    row.classList.toggle("sorted", row.firstChild.textContent === key);
  align(key);
  watch();
  announcement.textContent = `Sorted by ${key}${isReversed ? ", reversed" : ""}.`;
};
const align = (key) => {  // a row for a scene, or for a style, where that fits
  const columns = { scene: +gallery.dataset.styles, style: +gallery.dataset.scenes }[key] || 0;
  gallery.toggleAttribute("data-columns", 2 <= columns && columns <= 6);
  gallery.style.setProperty("--columns", columns);
};

const start = (video) => video.play().catch(() => {});
const isPlayingAll = () => playAll.getAttribute("aria-pressed") === "true";
const seen = new IntersectionObserver((entries) => {
  for (const { target, isIntersecting } of entries) {
    if (!isIntersecting) target.pause();
    else if (isPlayingAll() || (!canHover && !isCalm)) start(target);
  }
}, { threshold: 0.6 });
for (const tile of tiles) {
  const video = tile.querySelector("video");
  if (!video) continue;
  video.controls = false;
  if (isCalm) continue;
  for (const event of ["pointerenter", "focusin"]) tile.addEventListener(event, () => start(video));
  for (const event of ["pointerleave", "focusout"])
    tile.addEventListener(event, () => { if (canHover && !isPlayingAll()) video.pause(); });
}
const watch = () => {  // anew, which plays what is on the screen where all are to play
  for (const video of document.querySelectorAll(".tile video")) {
    seen.unobserve(video);
    seen.observe(video);
  }
};
playAll.addEventListener("click", () => {
  playAll.setAttribute("aria-pressed", !isPlayingAll());
  playAll.textContent = isPlayingAll() ? "Pause all" : "Play all";
  document.querySelectorAll(".tile video").forEach((video) => video.pause());
  watch();
});
watch();
if (gallery) align("scene");
for (const button of buttons) button.addEventListener("click", () => sortBy(button));
