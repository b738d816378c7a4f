// Rays through the bricks of a field, as styletrf/field/kernels/reference.py defines them.
precision highp float;
precision highp int;
precision highp sampler3D;
precision highp usampler3D;

uniform vec4 uStart[MAPS], uAcross[MAPS], uDown[MAPS], uAhead[MAPS];  // homogeneous grid points
uniform vec4 uPixel;  // pixel = xy + zw * gl_FragCoord
uniform vec3 uAxisLengths;
uniform float uDepthMin, uStep, uScale, uShift, uTermination, uMinWeight;
uniform usampler3D uEmpty, uDensityBricks, uBricksA, uBricksB;
uniform sampler3D uDensity, uColorsA, uColorsB, uSlopesA, uSlopesB;
uniform vec3 uDensityLast, uLastA, uLastB;  // the last lattice point along each axis
uniform vec4 uRangeA, uRangeB;  // low and high of colors, then of slopes
uniform vec3 uMeanA, uMeanB, uViewAcross, uViewDown, uViewAhead;  // directions in the world
uniform mat3 uAxesA, uAxesB;  // that turn directions, see view_directions.py
uniform vec3 uLeastA, uMostA, uTintA[MONOMIALS], uLeastB, uMostB, uTintB[MONOMIALS];
uniform vec3 uBackgroundA, uBackgroundB;
uniform vec2 uPowers;
uniform float uShareB, uSplit;  // of the second look; and left of which pixel it stands alone
out vec4 fragment;

const float FAR = 1e30;
vec3 turnedA, turnedB, tintA, tintB;  // of the pixel's direction

vec4 slope(int map, vec2 pixel) {
  return pixel.x * uAcross[map] + pixel.y * uDown[map] + uAhead[map];
}

// The depths at which a + depth * b >= 0, as near and far.
vec2 bound(vec2 held, float a, float b) {
  if (b > 0.0) return vec2(max(held.x, -a / b), held.y);
  if (b < 0.0) return vec2(held.x, min(held.y, -a / b));
  return a < 0.0 ? vec2(held.x, -FAR) : held;
}

vec2 depthsWithin(int map, vec4 slopes[MAPS]) {
  vec4 a = uStart[map], b = slopes[map];
  vec2 held = vec2(uDepthMin, FAR);
  for (int axis = 0; axis < 3; axis++) {
    held = bound(held, a.w + a[axis], b.w + b[axis]);
    held = bound(held, a.w - a[axis], b.w - b[axis]);
  }
  for (int other = 0; other < MAPS; other++)
    if (other != map) held = bound(held, a.w - uStart[other].w, b.w - slopes[other].w);
  return held;
}

// Trilinear between the eight points around a position of the grid.
vec4 lookup(sampler3D values, usampler3D bricks, vec3 last, vec3 position) {
  vec3 at = clamp((position * 0.5 + 0.5) * last, vec3(0), last);
  ivec3 brick = ivec3(min(at, last - 0.5)) / 8;
  uvec4 slot = texelFetch(bricks, brick, 0);
  if (slot.a == 0u) return vec4(0.5);  // what no view that was baked for shows
  vec3 inside = vec3(slot.xyz) * 9.0 + (at - vec3(brick * 8));
#ifdef FETCHED
  ivec3 low = ivec3(min(inside, vec3(slot.xyz) * 9.0 + 7.0));
  vec3 t = inside - vec3(low);
  vec4 columns[4];
  for (int k = 0; k < 4; k++) {
    ivec3 texel = low + ivec3(0, k & 1, k >> 1);
    columns[k] = mix(texelFetch(values, texel, 0), texelFetch(values, texel + ivec3(1, 0, 0), 0), t.x);
  }
  return mix(mix(columns[0], columns[1], t.y), mix(columns[2], columns[3], t.y), t.z);
#else
  return textureLod(values, (inside + 0.5) / vec3(textureSize(values, 0)), 0.0);
#endif
}

float softplus(float x) { return max(x, 0.0) + log(1.0 + exp(-abs(x))); }

vec3 sigmoid(vec3 x) { return 1.0 / (1.0 + exp(-x)); }

// What all colors gain along a direction that is turned, see view_directions.py.
vec3 tint(vec3 turned, vec3 least, vec3 most, vec3 coefficients[MONOMIALS]) {
  vec3 t = clamp(turned, least, most), sum = vec3(0);
  int n = 0;
  for (int i = 0; i < 3; i++) {
    sum += t[i] * coefficients[n++];
    for (int j = i; j < 3; j++) {
      sum += t[i] * t[j] * coefficients[n++];
      for (int k = j; k < 3; k++) sum += t[i] * t[j] * t[k] * coefficients[n++];
    }
  }
  return sum;
}

// What a color gains along a direction that is turned, see color_refit.py; nothing where the range has no width.
float gain(sampler3D slopes, usampler3D bricks, vec3 last, vec4 range, vec3 position, vec3 turned) {
  if (range.z == range.w) return 0.0;
  vec3 slope = mix(vec3(range.z), vec3(range.w), lookup(slopes, bricks, last, position).rgb);
  return dot(slope, turned);
}

vec3 colorAt(vec3 position, float shareB) {
  vec3 a = vec3(0), b = vec3(0);
  if (shareB < 1.0) {
    vec3 base = mix(vec3(uRangeA.x), vec3(uRangeA.y), lookup(uColorsA, uBricksA, uLastA, position).rgb);
    a = sigmoid(base + gain(uSlopesA, uBricksA, uLastA, uRangeA, position, turnedA) + tintA);
  }
  if (shareB > 0.0) {
    vec3 base = mix(vec3(uRangeB.x), vec3(uRangeB.y), lookup(uColorsB, uBricksB, uLastB, position).rgb);
    b = sigmoid(base + gain(uSlopesB, uBricksB, uLastB, uRangeB, position, turnedB) + tintB);
  }
  return mix(a, b, shareB);
}

// How many steps lead out of the cube of empty voxels around a position.
int leap(vec3 position, vec3 stride, uint empty, vec3 voxels) {
  vec3 at = clamp((position * 0.5 + 0.5) * voxels, vec3(0), voxels - 1e-4);
  vec3 speed = stride * 0.5 * voxels, low = floor(at) - float(empty - 1u);
  vec3 high = low + float(2u * empty - 1u);
  vec3 room = mix(at - low, high - at, step(vec3(0), speed)) / max(abs(speed), vec3(1e-9));
  return max(1, int(ceil(min(min(room.x, room.y), min(room.z, 1e6)))));
}

void main() {
  vec2 pixel = uPixel.xy + uPixel.zw * gl_FragCoord.xy;
  float shareB = uSplit < 0.0 ? uShareB : gl_FragCoord.x < uSplit ? 1.0 : 0.0;
  float power = mix(uPowers.x, uPowers.y, shareB);
  vec3 background = mix(uBackgroundA, uBackgroundB, shareB);
  vec3 view = normalize(pixel.x * uViewAcross + pixel.y * uViewDown + uViewAhead);
  fragment = vec4(background, 1);

  vec4 slopes[MAPS];
  float nears[MAPS], fars[MAPS], lengths[MAPS], total = 0.0;
  for (int map = 0; map < MAPS; map++) slopes[map] = slope(map, pixel);
  for (int map = 0; map < MAPS; map++) {
    vec2 held = depthsWithin(map, slopes);
    nears[map] = held.x, fars[map] = held.y, lengths[map] = 0.0;
    if (!(held.x < held.y)) continue;
    vec4 first = uStart[map] + held.x * slopes[map], last = uStart[map] + held.y * slopes[map];
    lengths[map] = length((last.xyz / last.w - first.xyz / first.w) * uAxisLengths);
    total += lengths[map];
  }
  int steps = int(ceil(total / uStep));
  if (steps == 0) return;
  turnedA = uAxesA * (view - uMeanA), turnedB = uAxesB * (view - uMeanB);
  if (shareB < 1.0) tintA = tint(turnedA, uLeastA, uMostA, uTintA);
  if (shareB > 0.0) tintB = tint(turnedB, uLeastB, uMostB, uTintB);

  float thickness = total / float(steps) * uScale, ends = 0.0;
  vec3 voxels = vec3(textureSize(uEmpty, 0)), sum = vec3(0), hazeAt = vec3(0);
  float depth = 0.0, transmittance = 1.0, opacity = 0.0, kept = 0.0, heaviest = 0.0;
  int k = 0;
  for (int piece = 0; piece < MAPS && k < steps && transmittance >= uTermination; piece++) {
    int map = -1;
    for (int other = 0; other < MAPS; other++)
      if (lengths[other] > 0.0 && (map < 0 || nears[other] < nears[map])) map = other;
    if (map < 0) break;
    vec4 first = uStart[map] + nears[map] * slopes[map];
    vec4 last = uStart[map] + fars[map] * slopes[map];
    float share = lengths[map] / total;
    vec3 origin = first.xyz / first.w, direction = (last.xyz / last.w - origin) / share;
    float begin = ends;
    ends += share;
    lengths[map] = 0.0;
    vec3 stride = direction / float(steps);
    int end = ends > 1.0 - 1e-6 ? steps : min(steps, int(floor(ends * float(steps) - 0.5)) + 1);
    while (k < end) {
      vec3 position = origin + ((float(k) + 0.5) / float(steps) - begin) * direction;
      vec3 at = clamp((position * 0.5 + 0.5) * voxels, vec3(0), voxels - 1.0);
      uint empty = texelFetch(uEmpty, ivec3(at), 0).r;
      if (empty > 0u) {
        k = min(k + leap(position, stride, empty, voxels), end);
        continue;
      }
      k++;
      float raw = lookup(uDensity, uDensityBricks, uDensityLast, position).r;
      float tau = thickness * softplus(raw + uShift);
      float weight = transmittance * (1.0 - exp(-tau));
      depth += tau;
      transmittance = exp(-depth);
      opacity += weight;
      if (weight > uMinWeight) {
        float counted = pow(weight, power);
        sum += counted * colorAt(position, shareB);
        kept += counted;
      } else if (weight > heaviest) {
        heaviest = weight, hazeAt = position;
      }
      if (transmittance < uTermination) break;
    }
  }
  if (kept == 0.0 && opacity > uMinWeight) sum = colorAt(hazeAt, shareB), kept = 1.0;
  if (kept > 0.0) fragment.rgb = mix(background, sum / kept, min(opacity, 1.0));
}
