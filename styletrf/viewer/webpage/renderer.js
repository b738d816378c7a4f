// Draws a view of the scene into a texture, adds views up, and shows their mean on the canvas.
const UNITS = { uEmpty: 0, uDensityBricks: 1, uDensity: 2, uBricksA: 3, uColorsA: 4, uBricksB: 5, uColorsB: 6,
  uShown: 7, uSlopesA: 8, uSlopesB: 9 };
const WHOLE = `#version 300 es
void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0, 1); }`;
const SHOW = `#version 300 es
precision highp float;
uniform sampler2D uShown;
uniform vec2 uSize;
out vec4 fragment;
void main() { fragment = vec4(texture(uShown, gl_FragCoord.xy / uSize).rgb, 1); }`;

const NO_ROOM = "The graphics card has too little memory for this scene.";

const programOf = (gl, fragment) => {
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, WHOLE], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost())
      throw new Refusal(`This browser cannot compile the renderer: ${gl.getShaderInfoLog(shader)}`);
  }
  gl.linkProgram(program);
  const places = new Map();
  const place = (name) => {
    if (!places.has(name)) places.set(name, gl.getUniformLocation(program, name));
    return places.get(name);
  };
  return { program, place };
};

const texture3D = (gl, unit, format, size, texels, filter) => {
  const [inside, layout, kind] = format, texture = gl.createTexture();
  gl.activeTexture(gl.TEXTURE0 + unit);
  gl.bindTexture(gl.TEXTURE_3D, texture);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
  gl.texImage3D(gl.TEXTURE_3D, 0, inside, ...size, 0, layout, kind, texels);
  for (const name of ["MIN_FILTER", "MAG_FILTER"]) gl.texParameteri(gl.TEXTURE_3D, gl[`TEXTURE_${name}`], filter);
  for (const name of ["S", "T", "R"]) gl.texParameteri(gl.TEXTURE_3D, gl[`TEXTURE_WRAP_${name}`], gl.CLAMP_TO_EDGE);
  return texture;
};

// Whether memory ran out since this was asked the last time; a card may report several errors.
const hasRunOut = (gl) => Array.from({ length: 8 }, () => gl.getError()).includes(gl.OUT_OF_MEMORY);

const sizeOf = (layout) => [layout.across * APRON, layout.across * APRON, layout.deep * APRON];

// A texture of bricks, or null if there is no memory; slabOf gives the texels of all bricks at one depth.
const slabTexture = async (gl, unit, format, layout, slabOf) => {
  hasRunOut(gl);  // for what was drawn before
  const size = sizeOf(layout), [wide] = size, texture = texture3D(gl, unit, format, size, null, gl.LINEAR);
  const without = () => { gl.deleteTexture(texture); return null; };
  if (hasRunOut(gl)) return without();
  for (let slab = 0; slab < layout.deep; slab++) {
    await rest();
    gl.activeTexture(gl.TEXTURE0 + unit);  // pictures may be drawn meanwhile
    gl.bindTexture(gl.TEXTURE_3D, texture);
    gl.texSubImage3D(gl.TEXTURE_3D, 0, 0, 0, slab * APRON, wide, wide, APRON, format[1], format[2], slabOf(slab));
  }
  return hasRunOut(gl) ? without() : texture;  // some allocate late
};

// The homogeneous grid points along the ray of a pixel: start + Z (x across + y down + ahead).
const raysOf = (map, view) => {
  const [pose, row] = [view.pose, (i) => map.slice(4 * i, 4 * i + 4)];
  const point = (k) => [0, 1, 2, 3].map((i) => {
    const [x, y, z, w] = row(i);
    return x * pose[k] + y * pose[4 + k] + z * pose[8 + k] + (k === 3 ? w : 0);
  });
  const across = point(0).map((v) => v / view.fx), down = point(1).map((v) => v / view.fy);
  const ahead = point(2).map((v, i) => v - across[i] * view.cx - down[i] * view.cy);
  return { uStart: point(3), uAcross: across, uDown: down, uAhead: ahead };
};

const makeRenderer = (canvas, scene, fragment) => {
  const gl = canvas.getContext("webgl2", { antialias: false, alpha: false, powerPreference: "high-performance" });
  if (!gl) throw new Refusal("This viewer needs WebGL2. Use a browser of 2021 or later, with hardware acceleration on.");
  const isFine = Boolean(gl.getExtension("EXT_color_buffer_float"));
  const head = `#version 300 es\n#define MAPS ${scene.maps.length}\n#define MONOMIALS ${MONOMIALS}\n${scene.fetched ? "#define FETCHED\n" : ""}`;
  const march = programOf(gl, head + fragment), show = programOf(gl, SHOW);
  const mostTexels = gl.getParameter(gl.MAX_3D_TEXTURE_SIZE);
  const layouts = new Map(), classes = new Map(), looks = [];
  const target = { texture: gl.createTexture(), frame: gl.createFramebuffer(), width: 0, height: 0 };
  const FORMATS = {
    empty: [gl.R8UI, gl.RED_INTEGER, gl.UNSIGNED_BYTE], bricks: [gl.RGBA8UI, gl.RGBA_INTEGER, gl.UNSIGNED_BYTE],
    density: [gl.R16F, gl.RED, gl.FLOAT], colors: [gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE],
  };
  gl.bindVertexArray(gl.createVertexArray());
  gl.useProgram(show.program);
  gl.uniform1i(show.place("uShown"), UNITS.uShown);
  gl.useProgram(march.program);
  for (const [name, unit] of Object.entries(UNITS)) gl.uniform1i(march.place(name), unit);
  gl.uniform3fv(march.place("uAxisLengths"), scene.axisLengths);
  for (const [name, value] of Object.entries(scene.march)) gl.uniform1f(march.place(name), value);

  const layoutNamed = (lattice) => {
    const name = JSON.stringify(lattice);
    if (!layouts.has(name))
      layouts.set(name, layoutOf(lattice, mostTexels).then((layout) => {
        const bricks = texture3D(gl, UNITS.uBricksA, FORMATS.bricks, layout.grid, directoryOf(layout), gl.NEAREST);
        return { ...layout, bricksTexture: bricks };
      }));
    return layouts.get(name);
  };
  const classesNamed = (look, layout) => {
    const name = look.classes.values;
    if (!classes.has(name)) classes.set(name, classesOf(look.classes, look.spacings.length, layout));
    return classes.get(name);
  };
  const bind = (unit, texture) => { gl.activeTexture(gl.TEXTURE0 + unit); gl.bindTexture(gl.TEXTURE_3D, texture); };

  const loadDensity = async () => {
    const { density, empty } = scene, layout = await layoutNamed(density.lattice);
    const slabOf = await densitiesOf(density, layout);
    const texture = await slabTexture(gl, UNITS.uDensity, FORMATS.density, layout, slabOf);
    if (!texture) throw new Refusal(NO_ROOM);
    bind(UNITS.uDensity, texture);
    bind(UNITS.uDensityBricks, layout.bricksTexture);
    const voxels = await bytesOf(empty.values, empty.size.reduce((a, b) => a * b));
    texture3D(gl, UNITS.uEmpty, FORMATS.empty, empty.size, voxels, gl.NEAREST);
    gl.useProgram(march.program);
    gl.uniform3fv(march.place("uDensityLast"), layout.last);
    return layout.bricks.length;
  };
  // Of the textures of a look.
  const sizeOfLook = async (k) => {
    const look = scene.looks[k], texels = sizeOf(await layoutNamed(look.lattice)).reduce((a, b) => a * b);
    return (look.slopes ? 2 : 1) * 4 * texels;
  };
  // Resolves to whether there was room.
  const loadLook = async (k) => {
    const look = scene.looks[k], layout = await layoutNamed(look.lattice);
    const ofPoints = await classesNamed(look, layout);
    const upload = async (values) => {
      const slabOf = await colorsOf(values, look.spacings, ofPoints, layout);
      const bytesOfSlab = (slab) => new Uint8Array(slabOf(slab).buffer);
      return slabTexture(gl, UNITS.uColorsA, FORMATS.colors, layout, bytesOfSlab);
    };
    const colorsTexture = await upload(look.colors), slopesTexture = look.slopes && await upload(look.slopes);
    const loaded = { ...look, layout, colorsTexture, slopesTexture, directions: await directionsOf(look.directions) };
    if (!colorsTexture || (look.slopes && !slopesTexture)) return free(loaded);
    looks[k] = loaded;
    return true;
  };
  const free = (look) => {
    gl.deleteTexture(look.colorsTexture);
    gl.deleteTexture(look.slopesTexture);
    return false;
  };
  const dropLook = (k) => { free(looks[k]); delete looks[k]; };

  const resize = (width, height) => {
    if (target.width === width && target.height === height) return;
    Object.assign(target, { width, height });
    gl.activeTexture(gl.TEXTURE0 + UNITS.uShown);
    gl.bindTexture(gl.TEXTURE_2D, target.texture);
    const format = isFine ? [gl.RGBA16F, gl.RGBA, gl.HALF_FLOAT] : [gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE];
    gl.texImage2D(gl.TEXTURE_2D, 0, format[0], width, height, 0, format[1], format[2], null);
    for (const name of ["MIN_FILTER", "MAG_FILTER"]) gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_${name}`], gl.LINEAR);
    for (const name of ["S", "T"]) gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_WRAP_${name}`], gl.CLAMP_TO_EDGE);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, target.texture, 0);
  };
  const useLook = (letter, look) => {
    bind(UNITS[`uBricks${letter}`], look.layout.bricksTexture);
    bind(UNITS[`uColors${letter}`], look.colorsTexture);
    bind(UNITS[`uSlopes${letter}`], look.slopesTexture ?? look.colorsTexture);
    const { low, high } = look.slopes ?? { low: 0, high: 0 };
    const { mean, axes, least, most, tint } = look.directions;
    gl.uniform3fv(march.place(`uLast${letter}`), look.layout.last);
    gl.uniform4f(march.place(`uRange${letter}`), look.colors.low, look.colors.high, low, high);
    gl.uniform3fv(march.place(`uMean${letter}`), mean);
    gl.uniformMatrix3fv(march.place(`uAxes${letter}`), true, axes);
    gl.uniform3fv(march.place(`uLeast${letter}`), least);
    gl.uniform3fv(march.place(`uMost${letter}`), most);
    gl.uniform3fv(march.place(`uTint${letter}`), tint);
    gl.uniform3fv(march.place(`uBackground${letter}`), look.background);
  };

  // picture: width, height, view (in its pixels), a and b (looks), shareB, split (0 to 1, or less
  // than 0 for none), offset (of the rays from the middles of pixels), first and end (rows), count
  // (of the pictures added up, with this one).
  const draw = (picture) => drawLooks(picture, looks[picture.a], looks[picture.b]);
  const drawLooks = (picture, a, b) => {
    const { width, height, first = 0, end = height, offset = [0, 0], count = 1, split = -1 } = picture;
    resize(width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
    gl.viewport(0, 0, width, height);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(0, first, width, end - first);
    gl.useProgram(march.program);
    const rays = scene.maps.map((map) => raysOf(map, picture.view));
    for (const name of Object.keys(rays[0]))
      gl.uniform4fv(march.place(name), rays.flatMap((each) => each[name]));
    const { pose, fx, fy, cx, cy } = picture.view;
    const across = column(pose, 0).map((v) => v / fx), down = column(pose, 1).map((v) => v / fy);
    gl.uniform3fv(march.place("uViewAcross"), across);
    gl.uniform3fv(march.place("uViewDown"), down);
    gl.uniform3fv(march.place("uViewAhead"), column(pose, 2).map((v, i) => v - across[i] * cx - down[i] * cy));
    useLook("A", a);
    useLook("B", b);
    gl.uniform2f(march.place("uPowers"), a.power, b.power);
    gl.uniform4f(march.place("uPixel"), offset[0], height + offset[1], 1, -1);
    gl.uniform1f(march.place("uShareB"), picture.shareB);
    gl.uniform1f(march.place("uSplit"), split < 0 ? -1 : split * width);
    if (count > 1) gl.enable(gl.BLEND);
    gl.blendColor(0, 0, 0, 1 / count);
    gl.blendFunc(gl.CONSTANT_ALPHA, gl.ONE_MINUS_CONSTANT_ALPHA);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.disable(gl.BLEND);
    gl.disable(gl.SCISSOR_TEST);
  };
  const present = () => {
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.useProgram(show.program);
    gl.uniform2f(show.place("uSize"), canvas.width, canvas.height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  };
  // Draws an empty scene: a graphics card compiles at its first picture, here while data is unpacked.
  const warmUp = () => {
    const one = (unit, format, texels, filter) => texture3D(gl, unit, format, [1, 1, 1], texels, filter);
    one(UNITS.uEmpty, FORMATS.empty, new Uint8Array([1]), gl.NEAREST);
    one(UNITS.uDensity, FORMATS.density, new Float32Array(1), gl.LINEAR);
    const bricksTexture = one(UNITS.uDensityBricks, FORMATS.bricks, new Uint8Array(4), gl.NEAREST);
    const colorsTexture = one(UNITS.uColorsA, FORMATS.colors, new Uint8Array(4), gl.LINEAR);
    const layout = { last: [1, 1, 1], bricksTexture }, colors = { low: 0, high: 0 };
    const directions = NO_DIRECTIONS, background = [0, 0, 0];
    const look = { layout, colors, colorsTexture, directions, background, power: 1 };
    drawLooks({ view: scene.path[0], width: 1, height: 1, shareB: 0 }, look, look);
    present();
  };
  // What was drawn, in [0, 1], three numbers a pixel, the upper left one first.
  const read = () => {
    const { width, height } = target, kind = isFine ? gl.FLOAT : gl.UNSIGNED_BYTE;
    const texels = new (isFine ? Float32Array : Uint8Array)(width * height * 4), colors = [];
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
    gl.readPixels(0, 0, width, height, gl.RGBA, kind, texels);
    for (let y = height - 1; y >= 0; y--)
      for (let k = y * width * 4; k < (y + 1) * width * 4; k++)
        if ((k & 3) < 3) colors.push(isFine ? texels[k] : texels[k] / 255);
    return colors;
  };
  // Resolves when all that was asked for is drawn.
  const fence = () => new Promise((resolve) => {
    const sync = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    const ask = () => {
      const isDone = gl.isContextLost() || gl.getSyncParameter(sync, gl.SYNC_STATUS) === gl.SIGNALED;
      if (!isDone) return setTimeout(ask, 1);
      gl.deleteSync(sync);
      return resolve();
    };
    setTimeout(ask, 0);
  });
  return { warmUp, loadDensity, sizeOfLook, loadLook, dropLook, isLoaded: (k) => Boolean(looks[k]), draw, present, read, fence, addsUp: isFine };
};
