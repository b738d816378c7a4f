// What is shown, and in which order.
const inSearch = (text) => text.toLowerCase().normalize();  // macOS takes letters and accents apart
const gallery = document.querySelector(".gallery"), controls = document.querySelector(".controls");
const tiles = [...document.querySelectorAll(".tile")].map((tile) => {
  const { scene, style } = tile.dataset;
  const scores = JSON.parse(tile.dataset.scores), isMade = tile.classList.contains("made");
  return { tile, scene, style, scores, isMade, words: inSearch(`${scene} ${style}`) };
});

const named = new Intl.Collator().compare;
const byNames = (a, b) => named(a.scene, b.scene) || named(a.style, b.style);
const byScore = (a, b, key, sign) => {  // what has none comes last, either way round
  const [x, y] = [a.scores[key], b.scores[key]];
  if (x === undefined || y === undefined) return (x === undefined) - (y === undefined);
  return sign * (x - y);
};
const order = (key, sign) => (a, b) =>
  (key === "scene" || key === "style" ? sign * named(a[key], b[key]) : byScore(a, b, key, sign)) || byNames(a, b);

const field = (name) => controls.elements.namedItem(name);
const filter = () => {
  const words = inSearch(field("words").value).split(/\s+/).filter(Boolean);
  const scene = field("scene").value, style = field("style").value, state = field("state").value;
  const measure = field("measure").value, [low, high] = [field("low").value, field("high").value];
  const isWithin = ({ scores }) => {
    const score = scores[measure];
    return score !== undefined && (low === "" || score >= +low) && (high === "" || score <= +high);
  };
  return (each) =>
    words.every((word) => each.words.includes(word)) &&
    (!scene || scene === `=${each.scene}`) && (!style || style === `=${each.style}`) &&
    (!state || (state === "made") === each.isMade) && (!measure || isWithin(each));
};

const direction = document.querySelector(".direction"), count = document.querySelector(".count");
const isReversed = () => direction.getAttribute("aria-pressed") === "true";
const mark = ({ tile }, key) => {
  for (const name of tile.querySelectorAll("dt"))
    for (const part of [name, name.nextElementSibling]) part.classList.toggle("sorted", name.textContent === key);
  return tile;
};

// The page holds the first tiles only, and more as one scrolls, so that thousands stay quick.
const portion = 60;
let listed = tiles, held = 0;
const hold = (number) => {
  const more = listed.slice(held, held + number), key = field("key").value;
  gallery.append(...more.map((each) => mark(each, key)));
  held += more.length;
};
const update = () => {
  const key = field("key").value, chosen = field("key").selectedOptions[0];
  const sign = (chosen.dataset.best === "highest") === isReversed() ? 1 : -1;
  listed = tiles.filter(filter()).sort(order(key, sign));
  gallery.replaceChildren();
  held = 0;
  hold(portion);
  reach();
  count.textContent = `${listed.length} of ${tiles.length}, by ${chosen.text}${isReversed() ? ", reversed" : ""}.`;
};
const end = document.querySelector(".end");
const onEnd = new IntersectionObserver((entries) => {
  if (!entries.at(-1).isIntersecting || held === listed.length) return;
  hold(portion);
  reach();
}, { rootMargin: "1200px" });
const reach = () => {  // again, since an end that stays in view is reported once
  onEnd.unobserve(end);
  onEnd.observe(end);
};
if (controls) {
  direction.addEventListener("click", () => {
    direction.setAttribute("aria-pressed", !isReversed());
    update();
  });
  controls.addEventListener("submit", (event) => event.preventDefault());
  controls.addEventListener("input", update);
  update();
}
