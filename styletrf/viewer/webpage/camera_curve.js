// The camera's way through key frames, as styletrf/trajectory/camera_curve.py defines it: Catmull-Rom
// pieces with centripetal knots for places and for rotations, a monotone cubic for the lens, at an
// even speed.
const TURN = 0.5, ZOOM = 0.25, FINENESS = 512, CLOSEST = 1e-3;

const lerp = (a, b, share) => a.map((v, i) => (1 - share) * v + share * b[i]);
const slerp = (a, b, share) => {
  const angle = 2 * Math.asin(clamp(Math.hypot(...add(b, a, -1)) / 2, 0, 1)), sine = Math.sin(angle);
  const isLine = sine < 1e-9;
  const first = isLine ? 1 - share : Math.sin((1 - share) * angle) / sine;
  const second = isLine ? share : Math.sin(share * angle) / sine;
  const mixed = a.map((v, i) => first * v + second * b[i]), length = Math.hypot(...mixed);
  return length > 1e-9 ? mixed.map((v) => v / length) : a;
};
// A view of the path: center, quaternion w x y z, and the logarithm of the zoom.
const blended = (a, b, share) => ({
  center: lerp(a.center, b.center, share),
  turned: slerp(a.turned, b.turned, share),
  zoom: lerp([a.zoom], [b.zoom], share)[0],
});

// The quaternion w x y z of the rotation in a pose, with w >= 0; by the largest of the four.
const quaternionOf = (pose) => {
  const [xx, xy, xz, , yx, yy, yz, , zx, zy, zz] = pose;
  const rows = [
    [1 + xx + yy + zz, zy - yz, xz - zx, yx - xy],
    [zy - yz, 1 + xx - yy - zz, xy + yx, xz + zx],
    [xz - zx, xy + yx, 1 - xx + yy - zz, yz + zy],
    [yx - xy, xz + zx, yz + zy, 1 - xx - yy + zz],
  ];
  const largest = rows.reduce((best, row, k) => (row[k] > rows[best][best] ? k : best), 0);
  const row = rows[largest], length = Math.hypot(...row) * (row[0] < 0 ? -1 : 1);
  return row.map((v) => v / length);
};
const poseFrom = ([w, x, y, z], center) => poseOf(
  [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
  [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
  [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
  center,
);

// The value between the middle two of four values at four places; within the range of these two.
const monotone = ([v0, v1, v2, v3], [t0, t1, t2, t3], at) => {
  const width = t2 - t1, before = t1 - t0, after = t3 - t2, rise = v2 - v1;
  const slope = (w0, w1, d0, d1) => (d0 * d1 > 0
    ? 3 * (w0 + w1) * d0 * d1 / ((2 * w1 + w0) * d1 + (w1 + 2 * w0) * d0) : 0);
  const start = slope(before, width, (v1 - v0) / before, rise / width);
  const end = slope(width, after, rise / width, (v3 - v2) / after);
  const s = (at - t1) / width;
  const bend = start * s * (1 - s) ** 2 - end * s ** 2 * (1 - s);
  return v1 + rise * (3 - 2 * s) * s ** 2 + width * bend;
};

const wayMoved = (a, b) => {
  const apart = Math.min(Math.hypot(...add(a.turned, b.turned, -1)), Math.hypot(...add(a.turned, b.turned)));
  const turned = 4 * Math.asin(clamp(apart / 2, 0, 1));
  return Math.max(Math.hypot(...add(a.center, b.center, -1)), TURN * turned);
};
const wayBetween = (a, b) => Math.max(wayMoved(a, b), ZOOM * Math.abs(b.zoom - a.zoom));

// keys: views {pose, zoom}; returns the view at a knot, and the knots of the key frames.
const curveThrough = (keys, isClosed) => {
  let views = keys.map(({ pose, zoom }) => (
    { center: column(pose, 3), turned: quaternionOf(pose), zoom: Math.log(zoom) }));
  if (views.length === 1) views = [views[0], views[0]];
  if (isClosed) views = [views.at(-1), ...views, views[0], views[1]];
  for (let k = 1; k < views.length; k++) {  // the signs by which neighbors are closest
    const { turned } = views[k], product = turned.reduce((sum, v, i) => sum + v * views[k - 1].turned[i], 0);
    if (product < 0) views[k] = { ...views[k], turned: turned.map((v) => -v) };
  }
  let steps = views.slice(1).map((view, k) => Math.sqrt(wayMoved(views[k], view)));
  const widest = Math.max(...steps);
  steps = steps.map((step) => Math.max(step, widest > 0 ? CLOSEST * widest : 1));
  if (!isClosed) {  // the second one mirrored at the first, and so at the end
    views = [blended(views[0], views[1], -1), ...views, blended(views.at(-1), views.at(-2), -1)];
    steps = [steps[0], ...steps, steps.at(-1)];
  }
  const knots = steps.reduce((found, step) => [...found, found.at(-1) + step], [0]);
  const at = (knot) => {
    const last = knots.length - 3;
    let piece = 1;
    while (piece < last && knots[piece + 1] <= knot) piece++;
    const near = views.slice(piece - 1, piece + 3), places = knots.slice(piece - 1, piece + 3);
    const [v0, v1, v2, v3] = near, [t0, t1, t2, t3] = places;
    const share = (start, end) => (knot - start) / (end - start);
    const b = blended(v1, v2, share(t1, t2));
    const ab = blended(blended(v0, v1, share(t0, t1)), b, share(t0, t2));
    const bc = blended(b, blended(v2, v3, share(t2, t3)), share(t1, t3));
    return { ...blended(ab, bc, share(t1, t2)), zoom: monotone(near.map(({ zoom }) => zoom), places, knot) };
  };
  return { at, knots: knots.slice(1, -1) };
};

// The share of the way at a share of the time: see `eased` in camera_curve.py.
const eased = (time, easing) => {
  const ramp = easing / 2, peak = 1 / (1 - ramp);
  if (ramp < 1e-12) return time;
  if (time < ramp) return peak * time ** 2 / (2 * ramp);
  if (time > 1 - ramp) return 1 - peak * (1 - time) ** 2 / (2 * ramp);
  return peak * (time - ramp / 2);
};

// The views {pose, zoom} of `count` frames along key frames, at an even speed but for the easing.
const framesAlong = (keys, { isClosed, easing, count }) => {
  const { at, knots } = curveThrough(keys, isClosed), table = [knots[0]];
  for (let k = 1; k < knots.length; k++)
    for (let i = 1; i <= FINENESS; i++) table.push(knots[k - 1] + (knots[k] - knots[k - 1]) * i / FINENESS);
  const views = table.map(at), way = [0];
  for (let k = 1; k < views.length; k++) way.push(way[k - 1] + wayBetween(views[k - 1], views[k]));
  const frames = [];
  for (let k = 0, after = 1; k < count; k++) {
    const target = eased(k / (isClosed ? count : Math.max(count - 1, 1)), easing) * way.at(-1);
    while (after < way.length - 1 && way[after] < target) after++;
    const share = clamp((target - way[after - 1]) / (way[after] - way[after - 1] || 1), 0, 1);
    const view = at(table[after - 1] + share * (table[after] - table[after - 1]));
    frames.push({ pose: poseFrom(view.turned, view.center), zoom: Math.exp(view.zoom) });
  }
  return frames;
};
