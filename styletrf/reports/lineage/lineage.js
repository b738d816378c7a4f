const ago = (moment) => {
  const seconds = Math.max(0, (Date.now() - moment) / 1000);
  for (const [unit, length] of [["d", 86400], ["h", 3600], ["min", 60]])
    if (seconds >= length) return `${Math.floor(seconds / length)} ${unit} ago`;
  return "just now";
};
for (const time of document.querySelectorAll("time")) {
  const moment = new Date(time.dateTime);
  if (isNaN(moment)) continue;
  time.title = moment.toLocaleString();
  time.textContent = time.classList.contains("age") ? ago(moment) : `${time.textContent}, ${ago(moment)}`;
}

// What an artifact was made from, and what was made from it, while one points at it.
const plane = document.querySelector(".plane");
const lines = [...(plane?.querySelectorAll("path[data-from]") ?? [])];
const related = (number) => {
  const found = new Set([number]);
  for (const [from, to] of [["from", "to"], ["to", "from"]]) {
    const pending = [number];
    while (pending.length) {
      const at = pending.pop();
      for (const line of lines)
        if (line.dataset[to] === at) {
          line.classList.add("related");
          if (!found.has(line.dataset[from])) pending.push(line.dataset[from]);
          found.add(line.dataset[from]);
        }
    }
  }
  return found;
};
const leave = () => {
  plane.classList.remove("pointed");
  for (const each of plane.querySelectorAll(".related")) each.classList.remove("related");
};
const enter = ({ currentTarget }) => {
  leave();
  const found = related(currentTarget.dataset.number);
  for (const card of plane.querySelectorAll(".artifact")) card.classList.toggle("related", found.has(card.dataset.number));
  plane.classList.add("pointed");
};
for (const card of plane?.querySelectorAll(".artifact") ?? []) {
  for (const event of ["pointerenter", "focus"]) card.addEventListener(event, enter);
  for (const event of ["pointerleave", "blur"]) card.addEventListener(event, leave);
}
