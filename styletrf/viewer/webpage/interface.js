// Paintings, mixing, buttons, playing, and the page's address.
const $ = (id) => document.getElementById(id);
const refuse = (error) => {
  $("notice").textContent = error instanceof Refusal ? error.message : `The viewer stopped: ${error.message ?? error}`;
  $("notice").hidden = false;
  document.body.classList.add("refused");
};
const offer = (blob, name) => {  // as a download
  const link = document.createElement("a");
  Object.assign(link, { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
};
const isCalm = matchMedia("(prefers-reduced-motion: reduce)").matches;

const start = async () => {
  if (!$("end")) throw new Refusal("This file is incomplete: its end is missing. Copy or download it again.");
  if (!("DecompressionStream" in window)) throw new Refusal("This viewer needs a browser of 2023 or later.");
  const scene = JSON.parse($("scene").textContent), canvas = $("canvas");
  const renderer = makeRenderer(canvas, scene, $("march").textContent), navigation = makeNavigation(scene);
  canvas.addEventListener("webglcontextlost", () => refuse(new Refusal("The graphics card gave up. Load the page again.")));
  const begun = performance.now(), photographs = 0;
  const chosen = { a: Math.min(1, scene.looks.length - 1), b: photographs, share: 1, split: -1, frame: 0, isPlaying: false, clip: null };
  const memory = makeLookMemory(renderer, scene.mostBytes);
  let loop = null, last = 0, loaded = () => "", editor = null;
  const change = () => { loop?.change(); remember(); };

  // The address: the view, what is chosen, and how.
  let timer = 0;
  const remember = () => {
    clearTimeout(timer);
    timer = setTimeout(() => {
      const nameOf = (k) => scene.looks[k].name;  // numbers differ from viewer to viewer
      const words = new URLSearchParams({ view: navigation.toText(), style: nameOf(chosen.a), with: nameOf(chosen.b), share: chosen.share });
      if (chosen.split >= 0) words.set("split", chosen.split.toFixed(3));
      if (editor?.toText()) words.set("path", editor.toText());
      try { history.replaceState(null, "", `#${words}`); } catch { /* a page within another may have no address */ }
    }, 300);
  };
  // Takes all from the address but the looks, which it returns: they may have to be loaded.
  const recall = (address = location.href) => {
    clearTimeout(timer);  // what would be remembered is not what the address asks for
    const asked = { a: chosen.a, b: chosen.b };
    const words = new URLSearchParams(new URL(address).hash.slice(1)), numberOf = (name) => scene.looks.findIndex((look) => look.name === name);
    const among = (v) => (numberOf(v) >= 0 ? numberOf(v) : clamp(Math.floor(+v) || 0, 0, scene.looks.length - 1));
    navigation.fromText(words.get("view"));
    if (words.has("show")) asked.a = clamp(Math.floor(+words.get("show")) || 0, 0, scene.looks.length - 1);
    if (numberOf(words.get("style")) >= 0) asked.a = numberOf(words.get("style"));
    if (words.has("with")) asked.b = among(words.get("with"));
    if (words.has("share")) chosen.share = clamp(+words.get("share") || 0, 0, 1);
    chosen.split = words.has("split") ? clamp(+words.get("split") || 0, 0, 1) : -1;
    return asked;
  };
  const recallPath = () => editor.fromText(new URLSearchParams(location.hash.slice(1)).get("path"));

  // Paintings.
  const labels = [];
  const addLabel = (look, k) => {
    const label = document.createElement("label"), radio = document.createElement("input");
    Object.assign(radio, { type: "radio", name: "look", value: k });
    radio.addEventListener("change", () => choose(k));
    const image = document.createElement("img"), name = document.createElement("span");
    Object.assign(image, { src: look.thumbnail, alt: "" });
    name.textContent = label.title = look.name;
    label.append(radio, image, name);
    $("other").append(new Option(look.name, k));
    $("looks").append(label);
    labels.push(label);
  };
  scene.looks.forEach(addLabel);
  const report = (text) => { $("report").hidden = !text; $("report").textContent = text; };
  const { visible, show, loadFirst, loadOthers } = makeChosenLooks(chosen, scene.looks, renderer, memory, { refresh: () => refresh(), report });
  const choose = (k) => show({ a: k, b: k === chosen.b ? chosen.a : chosen.b });
  const refresh = () => {
    const { a, b, share, split } = visible(), isSplit = split >= 0, isSingle = scene.looks.length < 2;
    for (const k of [chosen.b, b, a]) memory.use(k);
    labels.forEach((label, k) => {
      label.firstChild.checked = k === chosen.a;
      label.classList.toggle("chosen", k === chosen.a);
      label.classList.toggle("unloaded", !renderer.isLoaded(k));
      $("other").options[k].disabled = k === chosen.a;
    });
    $("other").value = chosen.b;
    $("share").value = chosen.share;
    $("share").disabled = isSplit || isSingle;
    $("halve").disabled = $("other").disabled = isSingle;
    $("shareText").value = `${Math.round(100 * share)} % ${scene.looks[a].name}`;
    $("halve").setAttribute("aria-pressed", chosen.split >= 0);
    $("split").hidden = $("edge").hidden = $("sides").hidden = !isSplit;
    if (isSplit) $("split").value = split;
    $("stage").style.setProperty("--split", `${100 * split}%`);
    $("left").textContent = scene.looks[b].name;
    $("right").textContent = scene.looks[a].name;
    for (const [id, isOn, text] of [["play", !chosen.clip, "Play"], ["preview", chosen.clip, "Preview"]]) {
      const isPlaying = chosen.isPlaying && Boolean(isOn);
      $(id).setAttribute("aria-pressed", isPlaying);
      $(id).textContent = isPlaying ? "Pause" : text;
    }
    canvas.setAttribute("aria-label", `${scene.name} in the style of ${scene.looks[a].name}. Arrow keys turn, W A S D walk, plus and minus zoom.`);
    change();
  };
  const picture = (width, height) => {
    const { a, b, share, split } = visible();
    return { view: navigation.view(width, height), a, b, shareB: 1 - share, split };
  };

  // Buttons and sliders.
  const toggles = {
    play: () => {
      chosen.isPlaying = !chosen.isPlaying || Boolean(chosen.clip);
      chosen.frame = chosen.clip ? 0 : chosen.frame;
      chosen.clip = null;
      refresh();
    },
    halve: () => show({ split: chosen.split < 0 ? 0.5 : -1 }),
    reset: () => { Object.assign(chosen, { isPlaying: false, frame: 0, clip: null }); navigation.show(scene.path[0].pose); refresh(); },
    full: () => (document.fullscreenElement ? document.exitFullscreen() : $("main").requestFullscreen()).catch(() => {}),
    save: async () => {
      if (!loop) return;
      const { width, height } = canvas, asked = picture(width, height);
      const name = `${scene.name}-${scene.looks[asked.a].name}.png`, isWhole = await loop.whole();
      if (!isWhole) renderer.draw({ ...asked, width, height });
      renderer.present();
      canvas.toBlob((blob) => offer(blob, name));
      if (!isWhole) loop.change();
    },
  };
  for (const [id, act] of Object.entries(toggles)) $(id).addEventListener("click", act);
  $("full").hidden = !document.fullscreenEnabled;
  $("other").addEventListener("change", () => show({ b: +$("other").value }));
  $("share").addEventListener("input", () => show({ share: +$("share").value }));
  $("split").addEventListener("input", () => { chosen.split = +$("split").value; refresh(); });
  addEventListener("hashchange", (event) => { show(recall(event.newURL)); if (editor) recallPath(); });

  const stop = () => { if (chosen.isPlaying) { chosen.isPlaying = false; refresh(); } };
  const PRESSED = { " ": "play", x: "halve", p: "save", f: "full", Home: "reset" };
  const press = (key, isRepeated) => {
    const act = toggles[PRESSED[key]] ?? (key === "k" && (() => $("addKey").click()));
    if (act && !isRepeated) act();
    else if (scene.looks[+key - 1]) choose(+key - 1);
    else return Boolean(act);
    return true;
  };
  const move = bindInput(canvas, $("walk"), navigation, { stop, change, press });

  const advance = (frames) => {
    const clip = chosen.clip, count = clip?.frames.length ?? navigation.frames;
    chosen.frame += frames;
    if (clip && !clip.isClosed && chosen.frame >= count - 1) {
      chosen.frame = count - 1;
      stop();
    }
    chosen.frame %= count;
    if (!clip) return navigation.follow(Math.floor(chosen.frame));
    const { pose, zoom } = clip.frames[Math.floor(chosen.frame)];
    return navigation.show(pose, zoom);
  };
  const next = (now) => {
    const seconds = Math.min(0.1, (now - last) / 1000), isMoved = move(seconds);
    last = now;
    if (chosen.isPlaying) advance(seconds * scene.framesPerSecond);
    if (isMoved || chosen.isPlaying) remember();
    return isMoved || chosen.isPlaying;
  };
  const looksInWords = () => {
    const n = scene.looks.length, some = memory.count() < n ? `${memory.count()} of ` : "";
    return `${some}${n} look${n > 1 ? "s" : ""} loaded (${(memory.bytes() / 1e6).toFixed(0)} MB of textures)`;
  };
  const tell = ({ width, height, ms, count }) => {
    const pictures = count > 1 ? `, mean of ${count} pictures` : "";
    $("status").textContent = `${loaded()}${width} x ${height} in ${ms.toFixed(ms < 10 ? 1 : 0)} ms${pictures}`;
  };

  const fit = () => {
    const wide = canvas.clientWidth || 300, dense = Math.min(2, devicePixelRatio || 1);
    const width = Math.max(16, Math.round(Math.min(wide * dense, scene.mostPixels)));
    const height = Math.max(16, Math.round(width / navigation.aspect));
    if (canvas.width === width && canvas.height === height) return;
    Object.assign(canvas, { width, height });
    loop?.change();
  };
  $("main").style.setProperty("--aspect", navigation.aspect);
  new ResizeObserver(fit).observe(canvas);
  Object.assign(chosen, recall());
  fit();
  renderer.warmUp();
  const bricks = await renderer.loadDensity();
  await loadFirst();
  $("notice").hidden = true;
  loop = makeLoop(canvas, renderer, { next, picture, tell });
  editor = makePathEditor(scene, navigation, {
    changed: change,
    play: (frames, isClosed) => {
      if (chosen.isPlaying && chosen.clip) return stop();
      Object.assign(chosen, { clip: { frames, isClosed }, frame: 0, isPlaying: true });
      return refresh();
    },
    drawn: (view, width, height) => loop.aside(() => {
      renderer.draw({ ...picture(width, height), view, width, height });
      return renderer.read();
    }),
  });
  recallPath();
  refresh();
  await loop.start();
  const first = performance.now() - begun;
  await loadOthers(isCalm ? 0 : 30);
  const second = performance.now() - begun;
  loaded = () => `${looksInWords()}, ${bricks} bricks of 512 points, the first picture after ${(first / 1000).toFixed(1)} s, the last look after ${(second / 1000).toFixed(1)} s; `;
  refresh();
  if (scene.isLive) {
    offerSaving(editor, () => ({ a: chosen.a, b: chosen.b, share: chosen.share }));
    followServer(scene, async (look) => {
      scene.looks.push(look);
      addLabel(look, scene.looks.length - 1);
      refresh();
      await memory.load(scene.looks.length - 1);
      refresh();
    }).catch(refuse);
  }
  return { scene, renderer, navigation, chosen, loop, picture, choose, refresh, editor };
};

$("notice").textContent = "Loading ...";
const isWhole = new Promise((go) => document.addEventListener("DOMContentLoaded", go));
window.viewer = isWhole.then(start);
window.viewer.catch(refuse);
