// Key frames of a camera path, drawn from views, as `--path FILE` reads them (docs/paths.md).
const LONGEST_S = 600, MOST_KEYS = 100, KEY_PX = 112;

// In the capture's world, to which `matrix`, 4 x 4, leads from the normalized one.
const keyFrameOf = ({ pose, zoom }, lens, matrix) => {
  const row = (i) => matrix.slice(4 * i, 4 * i + 3), turned = (v) => [0, 1, 2].map((i) => dot(row(i), v));
  const axes = [0, 1, 2].map((k) => unit(turned(column(pose, k))));
  const position = turned(column(pose, 3)).map((v, i) => v + matrix[4 * i + 3]);
  const focal = zoom * (lens.width >= lens.height ? lens.fx / lens.width : lens.fy / lens.height);
  const rounded = (values, digits) => values.map((v) => +v.toPrecision(digits));
  return {
    position: rounded(position, 14),  // georeferenced ones are large
    orientation: rounded(quaternionOf(poseOf(...axes, position)), 9),
    fov_deg: +(2 * Math.atan(0.5 / focal) * 180 / Math.PI).toFixed(4),
  };
};

// A word as a shell reads it.
const quoted = (word) => (/[^\w@%+=:,./-]/.test(word) ? `'${word.replaceAll("'", `'"'"'`)}'` : word);

// changed() is called after a change; play(views, isClosed) shows them; drawn(view, width, height)
// returns the colors of a view, as numbers in [0, 1].
const makePathEditor = (scene, navigation, { changed, play, drawn }) => {
  const keys = [];  // {text, picture}
  const seconds = () => clamp(+$("seconds").value || 1, 0.1, LONGEST_S), isClosed = () => $("closed").checked;
  const easing = () => clamp(+$("easing").value || 0, 0, 1);
  const pictureOf = (text) => {
    const canvas = document.createElement("canvas"), width = KEY_PX, height = Math.round(KEY_PX / navigation.aspect);
    Object.assign(canvas, { width, height });
    const colors = drawn(navigation.view(width, height, navigation.seenFrom(text)), width, height);
    const shown = new ImageData(width, height);
    for (let k = 0; k < width * height; k++)
      for (let c = 0; c < 4; c++) shown.data[4 * k + c] = c < 3 ? 255 * colors[3 * k + c] : 255;
    canvas.getContext("2d").putImageData(shown, 0, 0);
    return canvas;
  };
  const button = (text, label, act, isOff = false) => {
    const made = document.createElement("button");
    Object.assign(made, { type: "button", textContent: text, disabled: isOff });
    made.setAttribute("aria-label", label);
    made.addEventListener("click", act);
    return made;
  };
  const card = (key, k) => {
    const item = document.createElement("li"), number = `key frame ${k + 1}`;
    const go = button("", `Go to ${number}`, () => { navigation.fromText(key.text); changed(); });
    go.append(key.picture);
    const swap = (other) => { [keys[k], keys[other]] = [keys[other], keys[k]]; refresh(); };
    item.append(
      go,
      button("\u2190", `Move ${number} earlier`, () => swap(k - 1), k === 0),
      button("\u2192", `Move ${number} later`, () => swap(k + 1), k === keys.length - 1),
      button("\u00d7", `Delete ${number}`, () => { keys.splice(k, 1); refresh(); }),
    );
    return item;
  };
  const refresh = () => {
    $("keys").replaceChildren(...keys.map(card));
    $("addKey").disabled = keys.length >= MOST_KEYS;
    for (const id of ["preview", "download", "savePath"]) $(id).disabled = keys.length === 0;
    $("saved").hidden = true;
    changed();
  };
  const place = (text) => keys.push({ text, picture: pictureOf(text) });
  const file = () => ({
    key_frames: keys.map(({ text }) => keyFrameOf(navigation.seenFrom(text), navigation.lens, scene.worldFromNormalized)),
    closed: isClosed(),
    easing: easing(),
  });
  const frames = () => framesAlong(keys.map(({ text }) => navigation.seenFrom(text)), {
    isClosed: isClosed(), easing: easing(), count: Math.max(1, Math.round(seconds() * scene.framesPerSecond)),
  });
  const report = (text, command = "") => {
    $("saved").hidden = false;
    $("savedText").textContent = text;
    $("command").textContent = command;
    $("command").hidden = $("copy").hidden = !command;
  };
  const download = () => {
    const name = `${scene.name}-path.json`, text = JSON.stringify(file(), null, 1) + "\n";
    offer(new Blob([text], { type: "application/json" }), name);
    report(`Downloaded as ${name}. This is added to the command of a fly-through to render it:`,
           `--path ${quoted(name)} --seconds ${seconds()}`);
  };
  const toText = () => keys.map(({ text }) => text).join(";");
  const fromText = (text) => {
    const found = (text || "").split(";").filter((each) => navigation.seenFrom(each)).slice(0, MOST_KEYS);
    if (found.join(";") === toText()) return;
    keys.length = 0;
    found.forEach(place);
    $("route").open ||= found.length > 0;
    refresh();
  };
  $("addKey").addEventListener("click", () => { place(navigation.toText()); refresh(); });
  $("preview").addEventListener("click", () => play(frames(), isClosed()));
  $("download").addEventListener("click", download);
  $("copy").addEventListener("click", () => {
    getSelection().selectAllChildren($("command"));
    navigator.clipboard?.writeText($("command").textContent).catch(() => {});
  });
  for (const id of ["seconds", "closed", "easing"]) $(id).addEventListener("input", () => { $("saved").hidden = true; });
  refresh();
  return { toText, fromText, file, frames, seconds, report };
};
