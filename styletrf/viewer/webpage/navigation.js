// Where the camera is, and how far it may go: near a camera that saw the scene, looking as that did.
const add = (a, b, t = 1) => a.map((v, i) => v + t * b[i]);
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => { const n = Math.hypot(...a) || 1; return a.map((v) => v / n); };
const clamp = (v, low, high) => Math.min(high, Math.max(low, v));
const column = (pose, k) => [pose[k], pose[4 + k], pose[8 + k]];
const poseOf = (right, down, ahead, center) => [0, 1, 2].flatMap((i) => [right[i], down[i], ahead[i], center[i]]);

const MOST_PITCH = 1.5, MOST_ZOOM = 8;

// A lens but for its zoom: the focal length down and the place of the principal point, by the focal length across.
const shapeOf = ({ width, height, fx, fy, cx, cy }) =>
  [fy / height, cx / width - 0.5, cy / height - 0.5].map((v) => v / (fx / width));

const makeNavigation = (scene) => {
  const path = scene.path, guides = scene.guides;
  const down = unit(scene.down);  // of the world, as most cameras hold it
  const level = (v) => add(v, down, -dot(v, down));
  const isLong = (v) => Math.hypot(...v) > 1e-3;
  const north = unit([2, 1].map((k) => level(column(path[0].pose, k))).find(isLong));
  const east = cross(down, north);
  const lens = path[0], aspect = lens.width / lens.height, usual = shapeOf(lens);
  const zooms = path.map((frame) => (frame.fx / frame.width) / (lens.fx / lens.width));  // of the fly-through's lens
  const leastZoom = Math.min(...zooms), mostZoom = MOST_ZOOM * Math.max(...zooms);
  let followed = 1;  // the part of the zoom that Play leaves behind: that of the frame or the view shown last
  const state = { center: [0, 0, 0], yaw: 0, pitch: 0, roll: 0, zoom: 1, shape: usual };

  const axes = ({ yaw, pitch, roll }) => {
    const heading = add(north.map((v) => v * Math.cos(yaw)), east, Math.sin(yaw));
    const ahead = add(heading.map((v) => v * Math.cos(pitch)), down, -Math.sin(pitch));
    const right = unit(cross(down, heading)), below = cross(ahead, right);
    return {
      ahead,
      right: add(right.map((v) => v * Math.cos(roll)), below, Math.sin(roll)),
      down: add(below.map((v) => v * Math.cos(roll)), right, -Math.sin(roll)),
    };
  };
  const look = (ahead) => {
    state.yaw = Math.atan2(dot(ahead, east), dot(ahead, north));
    state.pitch = Math.asin(clamp(-dot(ahead, down), -1, 1));
  };
  const show = (pose, zoom = 1, shape = usual) => {
    Object.assign(state, { center: column(pose, 3), zoom, shape, roll: 0 });
    followed = zoom;
    look(column(pose, 2));
    const flat = axes(state), right = column(pose, 0);
    state.roll = Math.atan2(dot(right, flat.down), dot(right, flat.right));
  };

  // The distance of the point that a drag turns about: of the focus, as far ahead as it is.
  const pivot = () => Math.max(scene.radius, dot(add(scene.focus, state.center, -1), axes(state).ahead));
  const bound = () => {
    const { ahead } = axes(state);
    let best = null, least = Infinity;
    for (const guide of guides) {
      const away = Math.hypot(...add(state.center, guide.center, -1)) / scene.radius;
      const turned = Math.acos(clamp(dot(ahead, guide.ahead), -1, 1)) / scene.reach;
      const distance = Math.max(away, turned);
      if (distance < least) [best, least] = [{ guide, away, turned }, distance];
    }
    if (least <= 1) return;
    const { guide, away, turned } = best;
    if (away > 1) state.center = add(guide.center, add(state.center, guide.center, -1), 1 / away);
    if (turned > 1) {
      const aside = unit(add(ahead, guide.ahead, -dot(ahead, guide.ahead)));
      look(add(guide.ahead.map((v) => v * Math.cos(scene.reach)), aside, Math.sin(scene.reach)));
    }
  };

  const inward = scene.looking === "inward" || scene.looking === "ahead";
  const turn = (x, y) => {  // by shares of the picture's height, as a drag does
    const angle = 1 / (lens.fy / lens.height) / state.zoom;
    const distance = pivot(), target = add(state.center, axes(state).ahead, distance);
    const most = Math.max(MOST_PITCH, Math.abs(state.pitch));  // a view that was given may be steeper
    state.yaw += (inward ? 1 : -1) * x * angle;
    state.pitch = clamp(state.pitch + (inward ? -1 : 1) * y * angle, -most, most);
    state.roll = 0;
    if (inward) {
      state.center = add(target, axes(state).ahead, -distance);
      bound();
      look(unit(add(target, state.center, -1)));
    }
    bound();
  };
  const steer = (x, y) => (inward ? turn(x, y) : turn(-x, -y));  // to the right and down, as keys do
  const slide = (x, y) => {
    const scale = pivot() / (lens.fy / lens.height) / state.zoom, { right, down: below } = axes(state);
    state.center = add(add(state.center, right, -x * scale), below, -y * scale);
    bound();
  };
  const walk = (x, y, z) => {  // by shares of the radius
    const { right, down: below, ahead } = axes(state);
    const by = add(add(right.map((v) => v * x), below, y), ahead, z);
    state.center = add(state.center, by, scene.radius);
    bound();
  };
  const zoomBy = (factor) => { state.zoom = clamp(state.zoom * factor, leastZoom, mostZoom); };
  const follow = (k) => {  // through the lens of a frame, zoomed as the user had the one before
    const zoom = clamp(state.zoom / followed, 1, MOST_ZOOM);
    show(path[k].pose, zoom * zooms[k], shapeOf(path[k]));
    followed = zooms[k];
  };

  const poseAt = (at) => { const { right, down: below, ahead } = axes(at); return poseOf(right, below, ahead, at.center); };
  const pose = () => poseAt(state);
  const view = (width, height, seen = { ...state, pose: pose() }) => {
    const focal = (lens.fx / lens.width) * seen.zoom, [down, right, below] = seen.shape.map((v) => focal * v);
    return { pose: seen.pose, fx: width * focal, fy: height * down, cx: width * (0.5 + right), cy: height * (0.5 + below) };
  };
  const NAMES = ["yaw", "pitch", "roll", "zoom"];
  const inText = (numbers) => numbers.map((v) => +v.toFixed(6)).join(",");
  const toText = () => {
    const own = inText(state.shape) === inText(usual) ? [] : state.shape;
    return inText([...state.center, ...NAMES.map((name) => state[name]), ...own]);
  };
  const parsed = (text) => {  // null if it is no view
    const numbers = (text || "").split(",").map(Number), own = numbers.slice(7);
    if (numbers.length < 7 || ![0, usual.length].includes(own.length) || !numbers.every(Number.isFinite)) return null;
    const [yaw, pitch, roll, zoom] = numbers.slice(3);
    return { center: numbers.slice(0, 3), yaw, pitch: clamp(pitch, -Math.PI / 2, Math.PI / 2), roll,
             zoom: clamp(zoom, leastZoom, mostZoom), shape: own.length ? own : usual };
  };
  const fromText = (text) => {
    const found = parsed(text);
    if (!found) return false;
    Object.assign(state, found);
    followed = found.zoom;  // which may be a frame's, or the user's as well
    bound();
    return true;
  };
  const seenFrom = (text) => {  // the pose and the lens of a view
    const found = parsed(text);
    return found && { pose: poseAt(found), zoom: found.zoom, shape: found.shape };
  };
  show(path[0].pose);
  return { aspect, lens, turn, steer, slide, walk, zoomBy, view, pose, show, toText, fromText, seenFrom, follow,
           frames: path.length };
};
