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
  const shown = { a: Math.min(1, scene.looks.length - 1), b: photographs, share: 1, split: -1, frame: 0, isPlaying: false, clip: null };
  const memory = makeLookMemory(renderer, scene.mostBytes);
  let loop = null, last = 0, loaded = () => "", editor = null;
  const change = () => { loop?.change(); remember(); };

  // The address: the view, what is shown, and how.
  let timer = 0;
  const remember = () => {
    clearTimeout(timer);
    timer = setTimeout(() => {
      const nameOf = (k) => scene.looks[k].name;  // numbers differ from viewer to viewer
      const words = new URLSearchParams({ view: navigation.toText(), style: nameOf(shown.a), with: nameOf(shown.b), share: shown.share });
      if (shown.split >= 0) words.set("split", shown.split.toFixed(3));
      if (editor?.toText()) words.set("path", editor.toText());
      try { history.replaceState(null, "", `#${words}`); } catch { /* a page within another may have no address */ }
    }, 300);
  };
  // Takes all from the address but the looks, which it returns: they may have to be loaded.
  const recall = (address = location.href) => {
    clearTimeout(timer);  // what would be remembered is not what the address asks for
    const asked = { a: shown.a, b: shown.b };
    const words = new URLSearchParams(new URL(address).hash.slice(1)), numberOf = (name) => scene.looks.findIndex((look) => look.name === name);
    const among = (v) => (numberOf(v) >= 0 ? numberOf(v) : clamp(Math.floor(+v) || 0, 0, scene.looks.length - 1));
    navigation.fromText(words.get("view"));
    if (words.has("show")) asked.a = clamp(Math.floor(+words.get("show")) || 0, 0, scene.looks.length - 1);
    if (numberOf(words.get("style")) >= 0) asked.a = numberOf(words.get("style"));
    if (words.has("with")) asked.b = among(words.get("with"));
    if (words.has("share")) shown.share = clamp(+words.get("share") || 0, 0, 1);
    shown.split = words.has("split") ? clamp(+words.get("split") || 0, 0, 1) : -1;
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
  // Of the looks, `shown` has the chosen ones. What is visible are those of them that are loaded.
  let visibleA = shown.a;
  const isMixed = () => shown.share < 1 || shown.split >= 0;
  const visible = () => {
    if (renderer.isLoaded(shown.a)) visibleA = shown.a;
    if (!isMixed() || !renderer.isLoaded(shown.b)) return { a: visibleA, b: visibleA, share: 1, split: -1 };
    return { a: visibleA, b: shown.b, share: shown.share, split: shown.split };
  };
  // Loads the chosen looks. A look that nobody would see takes no other's place.
  const loadChosen = async () => {
    for (const which of ["a", "b"]) {
      const k = shown[which], isSeen = () => shown.a === k || (shown.b === k && isMixed());
      if (renderer.isLoaded(k)) continue;
      const wasSeen = isSeen();
      if (wasSeen) report(`Loading ${scene.looks[k].name} ...`);
      const mayGo = (old) => isSeen() && ![visibleA, shown.a, isMixed() && shown.b].includes(old);
      const isHeld = await memory.load(k, mayGo);
      if (!wasSeen || !isSeen()) continue;
      report(isHeld ? "" : `The graphics card has too little memory for ${scene.looks[k].name} beside what is shown.`);
      if (!isHeld && k === shown.a) Object.assign(shown, { a: visibleA, b: shown.b === visibleA ? k : shown.b });
      else if (!isHeld) Object.assign(shown, { share: 1, split: -1 });
      refresh();
    }
    refresh();
  };
  const show = (changes) => {
    Object.assign(shown, changes);
    report("");
    refresh();
    if (![shown.a, shown.b].every(renderer.isLoaded)) loadChosen().catch(refuse);
  };
  const choose = (k) => show({ a: k, b: k === shown.b ? shown.a : shown.b });
  const refresh = () => {
    const { a, b, share, split } = visible(), isSplit = split >= 0, isSingle = scene.looks.length < 2;
    for (const k of [shown.b, b, a]) memory.use(k);
    labels.forEach((label, k) => {
      label.firstChild.checked = k === shown.a;
      label.classList.toggle("chosen", k === shown.a);
      label.classList.toggle("unloaded", !renderer.isLoaded(k));
      $("other").options[k].disabled = k === shown.a;
    });
    $("other").value = shown.b;
    $("share").value = shown.share;
    $("share").disabled = isSplit || isSingle;
    $("halve").disabled = $("other").disabled = isSingle;
    $("shareText").value = `${Math.round(100 * share)} % ${scene.looks[a].name}`;
    $("halve").setAttribute("aria-pressed", shown.split >= 0);
    $("split").hidden = $("edge").hidden = $("sides").hidden = !isSplit;
    if (isSplit) $("split").value = split;
    $("stage").style.setProperty("--split", `${100 * split}%`);
    $("left").textContent = scene.looks[b].name;
    $("right").textContent = scene.looks[a].name;
    for (const [id, isOn, text] of [["play", !shown.clip, "Play"], ["preview", shown.clip, "Preview"]]) {
      const isPlaying = shown.isPlaying && Boolean(isOn);
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
      shown.isPlaying = !shown.isPlaying || Boolean(shown.clip);
      shown.frame = shown.clip ? 0 : shown.frame;
      shown.clip = null;
      refresh();
    },
    halve: () => show({ split: shown.split < 0 ? 0.5 : -1 }),
    reset: () => { Object.assign(shown, { isPlaying: false, frame: 0, clip: null }); navigation.show(scene.path[0].pose); refresh(); },
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
  $("split").addEventListener("input", () => { shown.split = +$("split").value; refresh(); });
  addEventListener("hashchange", (event) => { show(recall(event.newURL)); if (editor) recallPath(); });

  const stop = () => { if (shown.isPlaying) { shown.isPlaying = false; refresh(); } };
  const PRESSED = { " ": "play", x: "halve", p: "save", f: "full", Home: "reset" };
  const press = (key, isRepeated) => {
    const act = toggles[PRESSED[key]] ?? (key === "k" && (() => $("addKey").click()));
    if (act && !isRepeated) act();
    else if (scene.looks[+key - 1]) choose(+key - 1);
    else return Boolean(act);
    return true;
  };
  const move = takeInput(canvas, $("walk"), navigation, { stop, change, press });

  const advance = (frames) => {
    const clip = shown.clip, count = clip?.frames.length ?? navigation.frames;
    shown.frame += frames;
    if (clip && !clip.isClosed && shown.frame >= count - 1) {
      shown.frame = count - 1;
      stop();
    }
    shown.frame %= count;
    if (!clip) return navigation.follow(Math.floor(shown.frame));
    const { pose, zoom } = clip.frames[Math.floor(shown.frame)];
    return navigation.show(pose, zoom);
  };
  const next = (now) => {
    const seconds = Math.min(0.1, (now - last) / 1000), isMoved = move(seconds);
    last = now;
    if (shown.isPlaying) advance(seconds * scene.framesPerSecond);
    if (isMoved || shown.isPlaying) remember();
    return isMoved || shown.isPlaying;
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
  Object.assign(shown, recall());
  fit();
  renderer.warmUp();
  const bricks = await renderer.loadDensity();
  visibleA = shown.a;  // another one may be chosen while it is loading
  if (!await memory.load(visibleA)) throw new Refusal(NO_ROOM);
  $("notice").hidden = true;
  loop = makeLoop(canvas, renderer, { next, picture, tell });
  editor = makePathEditor(scene, navigation, {
    changed: change,
    play: (frames, isClosed) => {
      if (shown.isPlaying && shown.clip) return stop();
      Object.assign(shown, { clip: { frames, isClosed }, frame: 0, isPlaying: true });
      return refresh();
    },
    drawn: (view, width, height) => {
      renderer.draw({ ...picture(width, height), view, width, height });
      return renderer.read();
    },
  });
  recallPath();
  refresh();
  await loop.start();
  const first = performance.now() - begun;
  if (isMixed()) await loadChosen();
  for (const k of scene.looks.keys()) {
    if (renderer.isLoaded(k)) continue;
    await new Promise((go) => setTimeout(go, isCalm ? 0 : 30));
    await memory.load(k);
    refresh();
  }
  const second = performance.now() - begun;
  loaded = () => `${looksInWords()}, ${bricks} bricks of 512 points, the first picture after ${(first / 1000).toFixed(1)} s, the last look after ${(second / 1000).toFixed(1)} s; `;
  refresh();
  if (scene.isLive) {
    offerSaving(editor, () => ({ a: shown.a, b: shown.b, share: shown.share }));
    followServer(scene, async (look) => {
      scene.looks.push(look);
      addLabel(look, scene.looks.length - 1);
      refresh();
      await memory.load(scene.looks.length - 1);
      refresh();
    }).catch(refuse);
  }
  return { scene, renderer, navigation, shown, loop, picture, choose, refresh, editor };
};

$("notice").textContent = "Loading ...";
const isWhole = new Promise((go) => document.addEventListener("DOMContentLoaded", go));
window.viewer = isWhole.then(start);
window.viewer.catch(refuse);
