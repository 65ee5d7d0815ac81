// GLSL ES 3.00. Lighting is linear, written out through a filmic curve and the sRGB transfer.

const MESH_VERTEX = `#version 300 es
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 scalars;  // error in mm, fold depth
layout(location = 3) in vec3 paint;    // linear; white where a mesh has one colour
layout(location = 4) in vec2 place;    // in its picture, from the upper left
uniform mat4 view_projection;
uniform mat4 light_projection;
out vec3 world;
out vec3 world_normal;
out vec4 light_position;
out vec2 scalar;
flat out vec3 painted;  // of the triangle's last corner
out vec2 picture_place;
void main() {
  picture_place = place;
  world = position;
  painted = paint;
  world_normal = normal;
  scalar = scalars;
  // off the surface: no self-shadowing stripes
  light_position = light_projection * vec4(position + 0.006 * normal, 1.0);
  gl_Position = view_projection * vec4(position, 1.0);
}`;

const COMMON = `
const vec3 kKey = normalize(vec3(0.45, 0.82, 0.62));
const vec3 kFill = normalize(vec3(-0.8, 0.25, 0.35));
uniform mediump sampler2DShadow shadow_map;
uniform float shadow_texel;
uniform vec3 background;

// Sixteen taps on a golden-angle spiral, turned by interleaved gradient noise (Jimenez 2014); the sampler compares and
// filters each.
float KeyLight(vec4 at, float radius) {
  vec3 p = at.xyz / at.w * 0.5 + 0.5;
  if (p.z >= 1.0) return 1.0;
  float turn = 6.2832 * fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
  float sum = 0.0;
  for (int i = 0; i < 16; ++i) {
    float angle = float(i) * 2.39996 + turn;
    float r = radius * sqrt((float(i) + 0.5) / 16.0) * shadow_texel;
    sum += texture(shadow_map, vec3(p.xy + r * vec2(cos(angle), sin(angle)), p.z - 0.0016));
  }
  return sum / 16.0;
}

vec3 Display(vec3 linear_color) {
  vec3 x = max(linear_color, 0.0);
  x = (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14);  // Narkowicz's fit of the ACES curve
  return pow(clamp(x, 0.0, 1.0), vec3(1.0 / 2.2));
}`;

const MESH_FRAGMENT = `#version 300 es
precision highp float;
in vec3 world;
in vec3 world_normal;
in vec4 light_position;
in vec2 scalar;
flat in vec3 painted;
in vec2 picture_place;
uniform vec3 eye;
uniform sampler2D picture;
uniform float least_alpha;  // 0: nothing is cut out
uniform int material;  // 0 cloth, 1 body, 2 cloth coloured by error
uniform float error_scale;
uniform sampler2D color_map;
uniform vec3 outer_color;
uniform vec3 inner_color;
out vec4 color;
${COMMON}
void main() {
  vec4 shown = texture(picture, picture_place);
  if (shown.a < least_alpha) discard;
  vec3 v = normalize(eye - world);
  vec3 n = normalize(world_normal);
  bool outside = gl_FrontFacing;
  if (!outside && material != 1) n = -n;
  float key = KeyLight(light_position, material == 1 ? 5.0 : 4.0);
  float lambert = max(dot(n, kKey), 0.0);
  float wrapped = max((dot(n, kKey) + 0.25) / 1.25, 0.0);
  float fill = max(dot(n, kFill) * 0.5 + 0.5, 0.0);
  float facing = max(dot(n, v), 0.0);
  float rim = pow(1.0 - facing, 3.0);
  vec3 sky = vec3(0.50, 0.56, 0.66);
  vec3 earth = vec3(0.22, 0.19, 0.17);
  vec3 ambient = mix(earth, sky, n.y * 0.5 + 0.5);
  float fold = (outside ? 1.0 : -1.0) * scalar.y;
  float cavity = material == 1 ? 1.0 : clamp(1.0 - 2.2 * fold, 0.5, 1.3);
  vec3 albedo = painted * shown.rgb * (outside || material == 1 ? outer_color : inner_color);
  float sheen = material == 0 ? 0.42 : 0.10;
  if (material == 2) {
    albedo = pow(texture(color_map, vec2(clamp(scalar.x / error_scale, 0.002, 0.998), 0.5)).rgb, vec3(2.2));
    vec3 flat_light = vec3(0.62 + 0.30 * wrapped * mix(0.55, 1.0, key) + 0.14 * ambient.y) * mix(1.0, cavity, 0.35);
    color = vec4(Display(albedo * flat_light * 1.02), 1.0);
    return;
  }
  float closed = outside || material == 1 ? 1.0 : 0.55;
  vec3 light = vec3(1.34, 1.26, 1.16) * mix(lambert, wrapped, 0.5) * mix(0.06, 1.0, key);
  light += vec3(0.13, 0.17, 0.24) * fill * closed;
  light += ambient * 0.42 * cavity * closed;
  vec3 shaded = albedo * light * mix(1.0, cavity, 0.5);
  vec3 tint = mix(vec3(1.0), albedo * 2.2, 0.6);
  shaded += sheen * rim * tint * (0.25 + 0.6 * key) * closed * (0.55 + 0.45 * n.y);
  color = vec4(Display(shaded), 1.0);
}`;

const GROUND_VERTEX = `#version 300 es
layout(location = 0) in vec2 corner;
uniform mat4 view_projection;
uniform mat4 light_projection;
uniform vec3 center;
out vec3 world;
out vec4 light_position;
void main() {
  world = vec3(center.x + corner.x * 9.0, center.y, center.z + corner.y * 9.0);
  light_position = light_projection * vec4(world, 1.0);
  gl_Position = view_projection * vec4(world, 1.0);
}`;

const GROUND_FRAGMENT = `#version 300 es
precision highp float;
in vec3 world;
in vec4 light_position;
uniform vec3 center;
uniform vec3 pool;      // brightness of the lit floor
uniform float line;     // strength of the metre grid
out vec4 color;
${COMMON}
float Grid(float cells) {
  vec2 at = world.xz * cells;
  vec2 width = fwidth(at);
  vec2 near = abs(fract(at - 0.5) - 0.5) / max(width, 1e-5);
  return (1.0 - clamp(min(near.x, near.y), 0.0, 1.0)) * (1.0 - clamp(max(width.x, width.y) * 2.0, 0.0, 1.0));
}
void main() {
  float distance_m = length(world.xz - center.xz);
  float fade = 1.0 - smoothstep(0.6, 5.5, distance_m);
  float key = KeyLight(light_position, 26.0);
  float contact = 1.0 - 0.28 * exp(-distance_m * distance_m / 0.16);
  vec3 floor_color = mix(background, pool, fade * 0.9);
  float lines = line * (Grid(1.0) + 0.35 * Grid(4.0)) * fade;
  floor_color = mix(floor_color, floor_color * (pool.g > 0.45 ? 0.82 : 1.7), lines);
  floor_color *= mix(1.0, mix(0.55, 1.0, key) * contact, smoothstep(4.0, 1.2, distance_m));
  color = vec4(floor_color, 1.0);
}`;

const DEPTH_VERTEX = `#version 300 es
layout(location = 0) in vec3 position;
uniform mat4 light_projection;
void main() { gl_Position = light_projection * vec4(position, 1.0); }`;

const DEPTH_FRAGMENT = `#version 300 es
precision mediump float;
void main() {}`;
