// Two results side by side, their videos at the same part of their paths.
const dialog = document.querySelector("dialog.comparison"), bar = document.querySelector(".chosen");
if (dialog) {
  let chosen = [];
  const box = (each) => each.tile.querySelector(".choose");
  const title = ({ scene, style }) => `${scene} · ${style}`;
  const update = () => {
    for (const each of tiles) {
      const isChosen = chosen.includes(each);
      each.tile.classList.toggle("chosen-one", isChosen);
      if (box(each)) box(each).checked = isChosen;
    }
    bar.hidden = !chosen.length;
    bar.querySelector(".names").textContent =
      chosen.length < 2 ? `${chosen.map(title)}: choose another to compare it with` : chosen.map(title).join(" and ");
    bar.querySelector(".open").disabled = chosen.length < 2;
  };
  for (const each of tiles)  // a third takes the place of the first
    box(each)?.addEventListener("change", () => {
      chosen = box(each).checked ? [...chosen, each].slice(-2) : chosen.filter((other) => other !== each);
      update();
    });
  const clear = () => { chosen = []; update(); };

  const element = (name, text = "", kind = "") =>
    Object.assign(document.createElement(name), { textContent: text, className: kind });
  const figure = (each) => {
    const shown = element("figure"), video = element("video"), caption = element("figcaption");
    const image = each.tile.querySelector(".picture img"), link = element("a", title(each));
    Object.assign(video, { src: image.dataset.video, poster: image.src, muted: true, loop: true, playsInline: true });
    video.setAttribute("aria-label", title(each));
    link.href = each.tile.querySelector("h2 a").href;
    caption.append(link);
    shown.append(video, caption);
    return shown;
  };
  const better = (key) => {
    const [a, b] = chosen.map(({ scores }) => scores[key]), options = [...field("key").options];
    if (a === undefined || b === undefined || a === b) return -1;
    return +((options.find((option) => option.value === key)?.dataset.best === "highest") === (b > a));
  };
  const measured = (each) => new Map([...each.tile.querySelectorAll("dt")].map((row) => [row.textContent, row.nextElementSibling.textContent]));
  const row = (name, texts, best = -1) => {
    const line = element("tr"), head = element("th", name);
    head.scope = "row";
    line.append(head, ...texts.map((text, k) => element("td", text, k === best ? "better" : "")));
    return line;
  };
  const compare = () => {
    dialog.querySelector(".pair").replaceChildren(...chosen.map(figure));
    const tables = chosen.map(measured), names = new Set(tables.flatMap((table) => [...table.keys()]));
    const head = row("", chosen.map(title));
    head.replaceChildren(...[...head.children].map((cell) => element("th", cell.textContent)));
    dialog.querySelector("thead").replaceChildren(head);
    dialog.querySelector("tbody").replaceChildren(
      ...[...names].map((name) => row(name, tables.map((table) => table.get(name) ?? ""), better(name))));
    dialog.showModal();
    together(dialog.querySelectorAll("video"));
  };

  const playing = dialog.querySelector(".play"), seek = dialog.querySelector(".seek");
  const apart = 0.03;  // of the path, how far the videos may be apart
  const share = (video) => video.currentTime / (video.duration || 1);
  const move = (video, to) => { if (video.duration) video.currentTime = to * video.duration; };
  const together = ([first, second]) => {
    const begin = () => { for (const video of [first, second]) video.play().catch(() => {}); };
    const follow = () => { if (Math.abs(share(first) - share(second)) > apart && !second.seeking) move(second, share(first)); };
    first.addEventListener("timeupdate", () => { seek.value = share(first); follow(); });
    for (const event of ["play", "pause"])
      first.addEventListener(event, () => { playing.textContent = first.paused ? "Play" : "Pause"; });
    playing.onclick = () => { if (first.paused) begin(); else for (const video of [first, second]) video.pause(); };
    seek.oninput = () => { for (const video of [first, second]) { video.pause(); move(video, +seek.value); } };
    playing.textContent = "Play";
    if (!isCalm) begin();
  };
  bar.querySelector(".open").addEventListener("click", compare);
  bar.querySelector(".clear").addEventListener("click", clear);
  dialog.querySelector(".close").addEventListener("click", () => dialog.close());
  dialog.addEventListener("close", () => dialog.querySelector(".pair").replaceChildren());
  update();
}
