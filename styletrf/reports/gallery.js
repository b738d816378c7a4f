// What is shown, and in which order.
const gallery = document.querySelector(".gallery"), controls = document.querySelector(".controls");
const tiles = [...document.querySelectorAll(".tile")].map((tile) => {
  const { scene, style } = tile.dataset;
  const scores = JSON.parse(tile.dataset.scores), isMade = tile.classList.contains("made");
  return { tile, scene, style, scores, isMade, words: `${scene} ${style}`.toLowerCase() };
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
  const words = field("words").value.toLowerCase().split(/\s+/).filter(Boolean);
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

const count = document.querySelector(".count");
const announce = (shown) => {
  const chosen = field("key").selectedOptions[0].text;
  count.textContent = `${shown} of ${tiles.length} shown, by ${chosen}${isReversed() ? ", reversed" : ""}.`;
};
let shown = tiles.length;
const show = () => {
  const isWanted = filter();
  shown = 0;
  for (const each of tiles) {
    const isShown = isWanted(each);
    shown += isShown;
    if (each.tile.hidden === isShown) each.tile.hidden = !isShown;
  }
  announce(shown);
};
const direction = document.querySelector(".direction");
const isReversed = () => direction?.getAttribute("aria-pressed") === "true";
const sort = () => {
  const key = field("key").value, highest = field("key").selectedOptions[0].dataset.best === "highest";
  const sorted = tiles.toSorted(order(key, highest === isReversed() ? 1 : -1));
  gallery.append(...sorted.map(({ tile }) => tile));
  for (const row of gallery.querySelectorAll("dt")) {
    const isSorted = row.textContent === key;
    if (row.classList.contains("sorted") === isSorted) continue;
    row.classList.toggle("sorted", isSorted);
    row.nextElementSibling.classList.toggle("sorted", isSorted);
  }
  announce(shown);
};
if (controls) {
  direction.addEventListener("click", () => {
    direction.setAttribute("aria-pressed", !isReversed());
    sort();
  });
  field("key").addEventListener("change", sort);
  controls.addEventListener("submit", (event) => event.preventDefault());
  controls.addEventListener("input", (event) => { if (event.target.name !== "key") show(); });
  if (field("key").value !== "scene") sort();  // as the browser restored the page
  show();
}
