// Controls: pointers, keys, paintings, mixing, and the page's address.
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
  const keys = new Set(), touched = new Set();  // those of HELD that are down
  let loop = null, last = 0, loaded = "", editor = null;
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
  const recall = () => {
    const words = new URLSearchParams(location.hash.slice(1)), numberOf = (name) => scene.looks.findIndex((look) => look.name === name);
    const among = (v) => (numberOf(v) >= 0 ? numberOf(v) : clamp(Math.floor(+v) || 0, 0, scene.looks.length - 1));
    navigation.fromText(words.get("view"));
    if (words.has("show")) shown.a = clamp(Math.floor(+words.get("show")) || 0, 0, scene.looks.length - 1);
    if (numberOf(words.get("style")) >= 0) shown.a = numberOf(words.get("style"));
    if (words.has("with")) shown.b = among(words.get("with"));
    if (words.has("share")) shown.share = clamp(+words.get("share") || 0, 0, 1);
    shown.split = words.has("split") ? clamp(+words.get("split") || 0, 0, 1) : -1;
    editor?.fromText(words.get("path"));
  };

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
  const choose = (k) => {
    if (k === shown.b) shown.b = shown.a;
    shown.a = k;
    refresh();
  };
  const refresh = () => {
    const isSplit = shown.split >= 0, isSingle = scene.looks.length < 2;
    labels.forEach((label, k) => {
      label.firstChild.checked = k === shown.a;
      label.firstChild.disabled = !renderer.isLoaded(k);
      label.classList.toggle("chosen", k === shown.a);
      $("other").options[k].disabled = k === shown.a || !renderer.isLoaded(k);
    });
    $("other").value = shown.b;
    $("share").value = shown.share;
    $("share").disabled = isSplit || isSingle;
    $("halve").disabled = $("other").disabled = isSingle;
    $("shareText").value = `${Math.round(100 * shown.share)} % ${scene.looks[shown.a].name}`;
    $("halve").setAttribute("aria-pressed", isSplit);
    $("split").hidden = $("edge").hidden = $("sides").hidden = !isSplit;
    if (isSplit) $("split").value = shown.split;
    $("stage").style.setProperty("--split", `${100 * shown.split}%`);
    $("left").textContent = scene.looks[shown.b].name;
    $("right").textContent = scene.looks[shown.a].name;
    for (const [id, isOn, text] of [["play", !shown.clip, "Play"], ["preview", shown.clip, "Preview"]]) {
      const isPlaying = shown.isPlaying && Boolean(isOn);
      $(id).setAttribute("aria-pressed", isPlaying);
      $(id).textContent = isPlaying ? "Pause" : text;
    }
    canvas.setAttribute("aria-label", `${scene.name} in the style of ${scene.looks[shown.a].name}. Arrow keys turn, W A S D walk, plus and minus zoom.`);
    change();
  };
  const picture = (width, height) => ({
    view: navigation.view(width, height), a: shown.a, b: renderer.isLoaded(shown.b) ? shown.b : shown.a,
    shareB: 1 - shown.share, split: shown.split,
  });

  // Buttons and sliders.
  const toggles = {
    play: () => {
      shown.isPlaying = !shown.isPlaying || Boolean(shown.clip);
      shown.frame = shown.clip ? 0 : shown.frame;
      shown.clip = null;
      refresh();
    },
    halve: () => { shown.split = shown.split < 0 ? 0.5 : -1; refresh(); },
    reset: () => { Object.assign(shown, { isPlaying: false, frame: 0, clip: null }); navigation.show(scene.path[0].pose); refresh(); },
    full: () => (document.fullscreenElement ? document.exitFullscreen() : $("main").requestFullscreen()).catch(() => {}),
    save: () => {
      const { width, height } = canvas;
      const isAtRest = loop.isAtRest();
      if (!isAtRest) renderer.draw({ ...picture(width, height), width, height });
      renderer.present();
      canvas.toBlob((blob) => offer(blob, `${scene.name}-${scene.looks[shown.a].name}.png`));
      if (!isAtRest) loop.change();
    },
  };
  for (const [id, act] of Object.entries(toggles)) $(id).addEventListener("click", act);
  $("full").hidden = !document.fullscreenEnabled;
  $("other").addEventListener("change", () => { shown.b = +$("other").value; refresh(); });
  $("share").addEventListener("input", () => { shown.share = +$("share").value; refresh(); });
  $("split").addEventListener("input", () => { shown.split = +$("split").value; refresh(); });
  addEventListener("hashchange", () => { recall(); refresh(); });

  // Pointers: one turns, with Shift or the right button it slides; two slide and zoom.
  const pointers = new Map();
  const stop = () => { if (shown.isPlaying) { shown.isPlaying = false; refresh(); } };
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

  // Keys, on the canvas: held ones move by the time they are held.
  const HELD = {
    ArrowLeft: [-1, 0, "turn"], ArrowRight: [1, 0, "turn"], ArrowUp: [0, -1, "turn"], ArrowDown: [0, 1, "turn"],
    w: [0, 0, 1], s: [0, 0, -1], a: [-1, 0, 0], d: [1, 0, 0], q: [0, 1, 0], e: [0, -1, 0],
  };
  const STEP = 0.1;  // of the radius
  const PRESSED = { " ": "play", x: "halve", p: "save", f: "full", Home: "reset" };
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key, number = +key - 1;
    if (HELD[key]) { stop(); keys.add(key); }
    else if (PRESSED[key] && !event.repeat) toggles[PRESSED[key]]();
    else if ("+=-".includes(key)) { navigation.zoomBy(key === "-" ? 0.9 : 1 / 0.9); change(); }
    else if (key === "k" && !event.repeat) $("addKey").click();
    else if (renderer.isLoaded(number)) choose(number);
    else return;
    event.preventDefault();
  });
  canvas.addEventListener("keyup", (event) => keys.delete(event.key.length === 1 ? event.key.toLowerCase() : event.key));
  canvas.addEventListener("blur", () => keys.clear());

  // The same by buttons, for fingers. Screen readers click without a pointer.
  for (const button of $("walk").children) {
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
    const seconds = Math.min(0.1, (now - last) / 1000);
    last = now;
    const held = new Set([...keys, ...touched]);
    for (const key of held) {
      const [x, y, z] = HELD[key];
      if (z === "turn") navigation.steer(x * seconds, y * seconds);
      else navigation.walk(x * seconds, y * seconds, z * seconds);
    }
    if (shown.isPlaying) advance(seconds * scene.framesPerSecond);
    if (held.size || shown.isPlaying) remember();
    return held.size > 0 || shown.isPlaying;
  };
  const tell = ({ width, height, ms, count }) => {
    const pictures = count > 1 ? `, mean of ${count} pictures` : "";
    $("status").textContent = `${loaded}${width} x ${height} in ${ms.toFixed(ms < 10 ? 1 : 0)} ms${pictures}`;
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
  recall();
  fit();
  renderer.warmUp();
  const bricks = await renderer.loadDensity();
  await renderer.loadLook(shown.a);
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
  recall();
  refresh();
  await loop.start();
  const first = performance.now() - begun;
  for (let k = 0; k < scene.looks.length; k++) {
    if (!renderer.isLoaded(k)) {
      await new Promise((go) => setTimeout(go, isCalm ? 0 : 30));
      await renderer.loadLook(k);
      refresh();
    }
  }
  const looks = scene.looks.length, second = performance.now() - begun;
  loaded = `${looks} look${looks > 1 ? "s" : ""}, ${bricks} bricks of 512 points, loaded in ${(first / 1000).toFixed(1)} s, all in ${(second / 1000).toFixed(1)} s; `;
  refresh();
  if (scene.isLive) {
    offerSaving(editor, () => ({ a: shown.a, b: shown.b, share: shown.share }));
    followServer(scene, async (look) => {
      scene.looks.push(look);
      await renderer.loadLook(scene.looks.length - 1);
      addLabel(look, scene.looks.length - 1);
      refresh();
    }).catch(refuse);
  }
  return { scene, renderer, navigation, shown, loop, picture, choose, refresh, editor };
};

$("notice").textContent = "Loading ...";
const isWhole = new Promise((go) => document.addEventListener("DOMContentLoaded", go));
window.viewer = isWhole.then(start);
window.viewer.catch(refuse);
