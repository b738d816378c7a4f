// From the blocks of the page to the contents of textures; the other side of coding.py and compression.py.
const SIDE = 8, APRON = SIDE + 1, POINTS = SIDE ** 3, BUSY_MS = 50, ESCAPE = 0xE000;

class Refusal extends Error {}

// Leaves the browser time for input and for pictures, every BUSY_MS.
let rested = performance.now();
const rest = async () => {
  if (performance.now() - rested < BUSY_MS) return;
  await new Promise((go) => setTimeout(go));
  rested = performance.now();
};

// The bytes of text that block_text.py wrote, two to a letter.
const bytesOfText = (text) => {
  const letters = new Uint16Array(text.length);
  let n = 0;
  for (let k = 1; k < text.length; k++) {
    const letter = text.charCodeAt(k);
    letters[n++] = letter === ESCAPE ? text.charCodeAt(++k) ^ 0x8000 : letter;
  }
  return new Uint8Array(letters.buffer, 0, 2 * (n - 1) + Number(text[0]));
};

const inflate = async (packed, size) => {
  const { readable, writable } = new DecompressionStream("deflate");
  const writer = writable.getWriter(), reader = readable.getReader(), bytes = new Uint8Array(size);
  writer.write(packed).catch(() => {});  // reading fails, too
  writer.close().catch(() => {});
  let at = 0;
  for (;;) {
    const { value, done } = await reader.read();
    if (done && at === size) return bytes;
    if (done) throw new RangeError("too short");
    bytes.set(value, at);
    at += value.length;
  }
};

// The unpacked bytes of a block, of which there are `size`.
const bytesOf = async (block, size) => {
  const element = document.getElementById(block);
  if (!element) throw new Refusal("A part of this file is missing. Copy the file again.");
  await rest();
  try {
    return await inflate(bytesOfText(element.textContent), size);
  } catch {
    throw new Refusal("A part of this file is damaged. Copy the file again.");
  }
};

// Where the bricks of a lattice are stored, and where they go in a texture.
const layoutOf = async (lattice, mostTexels) => {
  const grid = lattice.resolution.map((n) => Math.ceil(n / SIDE));
  const present = await bytesOf(lattice.present, grid[0] * grid[1] * grid[2]);
  const slots = new Int32Array(present.length).fill(-1), bricks = [];
  present.forEach((is, k) => { if (is) { slots[k] = bricks.length; bricks.push(k); } });
  const across = Math.max(1, Math.ceil(Math.cbrt(bricks.length)));
  if (across * APRON > mostTexels) throw new Refusal("This scene is larger than the graphics card's textures.");
  const deep = Math.max(1, Math.ceil(bricks.length / across ** 2));
  return { last: lattice.resolution.map((n) => n - 1), grid, slots, bricks, across, deep };
};

const placeOf = (layout, slot) => {
  const { across } = layout;
  return [slot % across, Math.floor(slot / across) % across, Math.floor(slot / across ** 2)];
};

// What turns directions, and how all colors change with them; see view_directions.py.
const MONOMIALS = 19, OF_DIRECTIONS = { mean: 3, axes: 9, least: 3, most: 3, tint: 3 * MONOMIALS };
const NO_DIRECTIONS = Object.fromEntries(Object.entries(OF_DIRECTIONS).map(([name, n]) => [name, new Float32Array(n)]));
const directionsOf = async (block) => {
  if (!block) return NO_DIRECTIONS;
  const size = Object.values(OF_DIRECTIONS).reduce((a, b) => a + b);
  const numbers = new Float32Array((await bytesOf(block, 4 * size)).buffer);
  let next = 0;
  return Object.fromEntries(Object.entries(OF_DIRECTIONS).map(([name, n]) => [name, numbers.slice(next, next += n)]));
};

// The texture that leads from a brick to its place: x, y, z of it, and 1.
const directoryOf = (layout) => {
  const places = new Uint8Array(layout.slots.length * 4);
  layout.bricks.forEach((brick, slot) => places.set([...placeOf(layout, slot), 1], 4 * brick));
  return places;
};

// Undoes the differences from the mean of the points before along x, y and z, row by row; the
// channels of a point are side by side.
const summed = (codes, channels) => {
  const x = channels, y = SIDE * x, z = SIDE * y;
  for (let row = 0; row < codes.length; row += y) {
    const isAfterY = row % z > 0, isAfterZ = row % (SIDE * z) >= z, first = row + x, end = row + y;
    if (isAfterY && isAfterZ) {
      for (let at = row; at < first; at++) codes[at] += codes[at - y] + codes[at - z] >> 1;
      for (let at = first; at < end; at++) codes[at] += (codes[at - x] + codes[at - y] + codes[at - z]) / 3 | 0;
    } else if (isAfterY || isAfterZ) {
      const step = isAfterY ? y : z;
      for (let at = row; at < first; at++) codes[at] += codes[at - step];
      for (let at = first; at < end; at++) codes[at] += codes[at - x] + codes[at - step] >> 1;
    } else for (let at = first; at < end; at++) codes[at] += codes[at - x];
  }
};

// The slots of the bricks whose first layers a brick's texels reach: its own, and those after it.
const neighborsOf = (layout, brick) => {
  const [nx, ny, nz] = layout.grid, at = [brick % nx, Math.floor(brick / nx) % ny, Math.floor(brick / (nx * ny))];
  return Array.from({ length: 8 }, (_, k) => {
    const x = at[0] + (k & 1), y = at[1] + (k >> 1 & 1), z = at[2] + (k >> 2);
    return x < nx && y < ny && z < nz ? layout.slots[x + nx * (y + ny * z)] : -1;
  });
};

// Sets texels[texel] = value(point) in a slab: the bricks at one depth of a texture.
const fillSlab = (texels, layout, slab, value) => {
  const { across, bricks } = layout, width = across * APRON, first = slab * across ** 2;
  texels.fill(0);
  for (let slot = first; slot < Math.min(first + across ** 2, bricks.length); slot++) {
    const [px, py] = placeOf(layout, slot), next = neighborsOf(layout, bricks[slot]);
    for (let row = 0; row < APRON ** 2; row++) {
      const y = row % APRON, z = Math.floor(row / APRON);
      const texel = px * APRON + width * (py * APRON + y + width * z);
      const corner = (y >> 3) * 2 + (z >> 3) * 4, inside = (z & 7) * 64 + (y & 7) * 8;
      const own = next[corner] * POINTS + inside, after = next[corner + 1] * POINTS + inside;
      if (own >= 0) for (let x = 0; x < SIDE; x++) texels[texel + x] = value(own + x);
      if (after >= 0) texels[texel + SIDE] = value(after);
    }
  }
};

// What gives the texels of a slab, as numbers of a kind; the array is the same for all slabs.
const slabsOf = (layout, Kind, value) => {
  const texels = new Kind(layout.across ** 2 * APRON ** 3);
  return (slab) => { fillSlab(texels, layout, slab, value); return texels; };
};

// Where the values of each context begin, if there are so many of each.
const startsOf = (counts) => {
  const starts = new Uint32Array(counts.length);
  for (let k = 1; k < counts.length; k++) starts[k] = starts[k - 1] + counts[k - 1];
  return starts;
};

// What is before a point along x, y and z in its brick, or 0.
const beforeX = (values, at) => (at & 7 ? values[at - 1] : 0);
const beforeY = (values, at) => (at & 56 ? values[at - SIDE] : 0);
const beforeZ = (values, at) => (at & 448 ? values[at - SIDE ** 2] : 0);

// The points of all bricks, in parts after which the browser may rest.
const PART = 256 * POINTS;

const densitiesOf = async ({ values, counts, low, step }, layout) => {
  const n = layout.bricks.length * POINTS, codes = new Uint16Array(n), bytes = await bytesOf(values, 2 * n);
  const next = startsOf(counts);
  for (let first = 0; first < n; first += PART) {
    await rest();
    for (let at = first; at < Math.min(first + PART, n); at++) {
      const sum = beforeX(codes, at) + beforeY(codes, at) + beforeZ(codes, at);
      const k = next[32 - Math.clz32(sum)]++;  // by the sum's number of digits
      codes[at] = bytes[k] | bytes[n + k] << 8;
    }
  }
  for (let k = 0; k < n; k++) codes[k] = codes[k] >> 1 ^ -(codes[k] & 1);  // of 0, 1, 2, 3: 0, -1, 1, -2
  await rest();
  summed(codes, 1);
  return slabsOf(layout, Float32Array, (point) => low + step * codes[point]);
};

// The class of each point, how much it changes in pictures (point_effects.py), of so many kinds; and how many
// points of each class there are without the first ones of bricks.
const classesOf = async ({ values, counts }, kinds, layout) => {
  const n = layout.bricks.length * POINTS, classes = new Uint8Array(n), bytes = await bytesOf(values, n);
  const next = startsOf(new Uint32Array((await bytesOf(counts, 4 * kinds ** 3)).buffer));
  const sizes = new Uint32Array(kinds);
  for (let first = 0; first < n; first += PART) {
    await rest();
    for (let at = first; at < Math.min(first + PART, n); at++) {
      const context = beforeX(classes, at) + kinds * (beforeY(classes, at) + kinds * beforeZ(classes, at));
      classes[at] = bytes[next[context]++];
      if (at % POINTS) sizes[classes[at]]++;
    }
  }
  return { classes, sizes };
};

// The texels of colors or slopes, whose multiples of the spacings of their classes are given class by class.
const MOST_OF_COLORS = 254;
const colorsOf = async ({ values, byGreen }, spacings, { classes, sizes }, layout) => {
  const bricks = layout.bricks.length, used = sizes.map((size, k) => (spacings[k] ? size : 0));
  const channel = bricks + used.reduce((a, b) => a + b), bytes = await bytesOf(values, 3 * channel);
  const multiples = new Int8Array(bytes.buffer), codes = new Int16Array(3 * classes.length);
  const next = startsOf(used).map((start) => bricks + start);
  const firsts = [0, 0, 0], apart = byGreen ? MOST_OF_COLORS : 0;  // that stands for no difference from green
  const leasts = [apart / 2, 0, apart / 2];  // of the first codes of bricks
  for (let brick = 0; brick < bricks; brick++) {
    if (!(brick & 255)) await rest();
    let to = 3 * POINTS * brick;
    for (let k = 0; k < 3; k++) {
      firsts[k] = firsts[k] + bytes[k * channel + brick] & 255;
      codes[to++] = leasts[k] + firsts[k];
    }
    for (let at = POINTS * brick + 1; at < POINTS * (brick + 1); at++, to += 3) {
      const kind = classes[at], spacing = spacings[kind];
      if (!spacing) continue;
      const from = next[kind]++;
      codes[to] = spacing * multiples[from];
      codes[to + 1] = spacing * multiples[from + channel];
      codes[to + 2] = spacing * multiples[from + 2 * channel];
    }
  }
  await rest();
  summed(codes, 3);
  const within = (code) => (code < 0 ? 0 : code > MOST_OF_COLORS ? MOST_OF_COLORS : code);  // a sum of means may lie beyond
  return slabsOf(layout, Uint32Array, (point) => {
    const at = 3 * point, second = codes[at + 1], added = byGreen ? second - apart : 0;
    return within(codes[at] + added) | second << 8 | within(codes[at + 2] + added) << 16;
  });
};
