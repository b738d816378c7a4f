// From the blocks of the page to the contents of textures; the other side of coding.py.
const SIDE = 8, APRON = SIDE + 1, POINTS = SIDE ** 3;

class Refusal extends Error {}

const bytesOf = async (block) => {
  const element = document.getElementById(block);
  if (!element) throw new Refusal("A part of this file is missing. Copy the file again.");
  const letters = atob(element.textContent);
  const packed = new Uint8Array(letters.length);
  for (let k = 0; k < letters.length; k++) packed[k] = letters.charCodeAt(k);
  const unpacked = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  try {
    return new Uint8Array(await new Response(unpacked).arrayBuffer());
  } catch {
    throw new Refusal("A part of this file is damaged. Copy the file again.");
  }
};

// Where the bricks of a lattice are stored, and where they go in a texture.
const layoutOf = async (lattice, mostTexels) => {
  const grid = lattice.resolution.map((n) => Math.ceil(n / SIDE));
  const present = await bytesOf(lattice.present);
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

// The texture that leads from a brick to its place: x, y, z of it, and 1.
const directoryOf = (layout) => {
  const places = new Uint8Array(layout.slots.length * 4);
  layout.bricks.forEach((brick, slot) => places.set([...placeOf(layout, slot), 1], 4 * brick));
  return places;
};

// Undoes the differences from the mean of the points before along x, y and z.
const summed = (differences, mask) => {
  for (let first = 0; first < differences.length; first += POINTS)
    for (let k = 1; k < POINTS; k++) {
      const at = first + k;
      let sum = 0, n = 0;
      if (k & 7) { sum += differences[at - 1]; n++; }
      if (k & 56) { sum += differences[at - 8]; n++; }
      if (k & 448) { sum += differences[at - 64]; n++; }
      differences[at] = (differences[at] + Math.floor(sum / n)) & mask;
    }
  return differences;
};

// Calls put(texel, point) for every texel of all bricks, with the layer shared with the next ones.
const unfold = (layout, put) => {
  const [nx, ny, nz] = layout.grid, width = layout.across * APRON;
  const next = new Int32Array(8);
  layout.bricks.forEach((brick, slot) => {
    const at = [brick % nx, Math.floor(brick / nx) % ny, Math.floor(brick / (nx * ny))];
    for (let k = 0; k < 8; k++) {
      const x = at[0] + (k & 1), y = at[1] + (k >> 1 & 1), z = at[2] + (k >> 2);
      next[k] = x < nx && y < ny && z < nz ? layout.slots[x + nx * (y + ny * z)] : -1;
    }
    const [px, py, pz] = placeOf(layout, slot).map((n) => n * APRON);
    for (let z = 0; z < APRON; z++)
      for (let y = 0; y < APRON; y++) {
        let texel = px + width * (py + y + width * (pz + z));
        const row = (z & 7) * 64 + (y & 7) * 8, corner = (y >> 3) * 2 + (z >> 3) * 4;
        for (let x = 0; x < APRON; x++, texel++) {
          const source = next[corner + (x >> 3)];
          if (source >= 0) put(texel, source * POINTS + row + (x & 7));
        }
      }
  });
};

const texelsOf = (layout) => layout.across ** 2 * layout.deep * APRON ** 3;

const densitiesOf = async (density, layout) => {
  const bytes = await bytesOf(density.values), n = layout.bricks.length * POINTS;
  const codes = new Uint16Array(n);
  for (let k = 0; k < n; k++) codes[k] = bytes[k] | (bytes[n + k] << 8);
  summed(codes, 0xffff);
  const texels = new Float32Array(texelsOf(layout));
  unfold(layout, (texel, point) => { texels[texel] = density.low + density.step * codes[point]; });
  return texels;
};

const colorsOf = async (values, layout) => {
  const bytes = await bytesOf(values.values), n = layout.bricks.length * POINTS;
  const [red, green, blue] = [0, 1, 2].map((k) => summed(bytes.subarray(k * n, (k + 1) * n), 0xff));
  const texels = new Uint8ClampedArray(texelsOf(layout) * 4);  // a mean of neighbors may lie beyond
  unfold(layout, (texel, point) => {
    texels[4 * texel] = values.gain * (red[point] + green[point] - 128);
    texels[4 * texel + 1] = values.gain * green[point];
    texels[4 * texel + 2] = values.gain * (blue[point] + green[point] - 128);
  });
  return new Uint8Array(texels.buffer);
};
