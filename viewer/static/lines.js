"use strict";
// Wide screen-space lines as expanded quads: in software GL several times faster than instanced ones.
(() => {
  const T = MeshCat.THREE,
    BANDS = 16; // most bands of a scale
  const VERTEX = `
in vec3 a0, a1, d0, d1;
in vec4 aux;                        // side (-1, 1 at the start; -2, 2 at the end), value, sample, look
uniform mat4 whole;                 // from mm to the clip space, multiplied in double precision
uniform vec2 size;                  // of the pane, px
uniform vec4 plane;                 // of the section: what is beyond is left out
uniform float width, k, cut, lift, rapids;
uniform float edges[${BANDS}];      // upper edges of the bands
uniform vec3 shades[${BANDS}];
uniform int bands;                  // 0: not coloured
uniform vec3 colour, faint, unknown;
flat out vec3 shade;
flat out vec4 style;                // dashes along x (1) or y (2); half width, half width of the core, px; opacity
flat out vec2 dash;
out vec2 place;                     // px from the middle line; distance beyond the section, mm
vec3 coded(float value) {
  if (bands == 0) return colour;
  if (value != value) return unknown;
  for (int i = 0; i < bands - 1; i++) if (value <= edges[i]) return shades[i];
  return shades[bands - 1];
}
float lifted(vec4 clip) { // depth as if it were some pixels nearer: later layers lie above earlier ones
  float nearer = lift * 2.0 / (projectionMatrix[1][1] * size.y) * clip.w;
  return (clip.z + projectionMatrix[2][2] * nearer) / (clip.w + projectionMatrix[2][3] * nearer) * clip.w;
}
uniform vec2 dashes;
void main() {
  vec4 p = whole * vec4(a0 + k * d0, 1.0), q = whole * vec4(a1 + k * d1, 1.0);
  float look = mod(aux.w, 8.0);
  bool chosen = aux.w > 7.5, rapid = look > 0.5 && look < 1.5, whisker = look > 2.5 && look < 3.5, dim = look > 3.5;
  if ((p.w < 1e-5 && q.w < 1e-5) || aux.z >= cut || (rapid && rapids < 0.5)) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); return; }
  if (p.w < 1e-5) p = mix(q, p, (q.w - 1e-5) / (q.w - p.w));
  if (q.w < 1e-5) q = mix(p, q, (p.w - 1e-5) / (p.w - q.w));
  vec2 dir = (q.xy / q.w - p.xy / p.w) * size;
  float span = length(dir);
  dir = span < 1e-6 ? vec2(1.0, 0.0) : dir / span;
  bool end = abs(aux.x) > 1.5;
  float core = rapid || dim ? 1.2 : whisker ? 1.0 : width, wide = chosen ? core + 4.5 : core;
  vec4 r = end ? q : p;
  r.z = lifted(r);
  place.x = sign(aux.x) * (wide * 0.5 + 0.75);
  place.y = dot(plane.xyz, end ? a1 : a0) - plane.w;
  r.xy += (vec2(-dir.y, dir.x) * place.x * 2.0 + dir * (end ? 0.5 : -0.5) * (whisker ? 0.0 : wide)) / size * r.w;
  gl_Position = r;
  dash = rapid ? vec2(5.0, 4.0) : chosen || whisker || dim ? vec2(1.0, 0.0) : dashes;
  style = vec4(abs(dir.x) > abs(dir.y) ? 1.0 : 2.0, wide * 0.5, chosen ? core * 0.5 : wide, whisker ? 0.55 : dim ? 0.5 : 1.0);
  shade = rapid || dim ? faint : coded(aux.y);
}`;
  // Edges fade over a pixel: smooth without multisampling, which would double the time of software GL. Dashes counted
  // along the longer screen axis join up over any number of short segments.
  const FRAGMENT = `
uniform float ratio, opacity;
uniform vec3 ink;
flat in vec3 shade;
flat in vec4 style;
flat in vec2 dash;
in vec2 place;
out vec4 result;
void main() {
  float across = abs(place.x), alpha = clamp(style.y + 0.5 - across, 0.0, 1.0) * style.w * opacity;
  if (alpha <= 0.0 || place.y > 0.0) discard;
  if (dash.y > 0.0 && mod(style.x > 1.5 ? gl_FragCoord.y : gl_FragCoord.x, (dash.x + dash.y) * ratio) > dash.x * ratio) discard;
  result = vec4(mix(shade, ink, clamp(across - style.z + 0.5, 0.0, 1.0)), alpha);
  gl_FragDepth = gl_FragCoord.z + 0.02 * (1.0 - clamp(style.y + 0.5 - across, 0.0, 1.0)); // a faint edge hides no line behind it
}`;

  class Lines {
    constructor(path, order) {
      this.path = path;
      this.order = order;
      const u = (this.uniforms = {});
      const start = {
        size: new T.Vector2(1, 1),
        plane: new T.Vector4(0, 0, 0, 1),
        dashes: new T.Vector2(...path.dashes),
        width: path.width,
        k: 0,
        cut: 1e9,
        lift: 1.5 + 1.5 * order,
        rapids: 1,
        ratio: 1,
        opacity: 1,
        edges: new Float32Array(BANDS),
        shades: Array.from({length: BANDS}, () => new T.Color("#777777")),
        bands: 0,
        whole: new T.Matrix4(),
        colour: new T.Color("#777777"),
        unknown: new T.Color("#777777"),
        faint: new T.Color("#999999"),
        ink: new T.Color("#000000"),
      };
      for (const [name, value] of Object.entries(start)) u[name] = {value};
      this.material = new T.ShaderMaterial({
        glslVersion: T.GLSL3,
        vertexShader: VERTEX,
        fragmentShader: FRAGMENT,
        uniforms: u, // one side: its corners always turn the same way, and three draws transparent bodies with two sides twice
        transparent: true,
      });
      this.mesh = new T.Mesh(new T.BufferGeometry(), this.material);
      this.mesh.frustumCulled = false;
      this.mesh.onBeforeRender = (renderer, scene, camera) =>
        u.whole.value.multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse).multiply(this.mesh.matrixWorld);
      this.mesh.renderOrder = 10 + order;
    }

    // Colours by band, or with null the line's own colour.
    set_bands(scale) {
      const u = this.uniforms;
      u.bands.value = scale ? scale.shades.length : 0;
      scale?.shades.forEach((shade, i) => {
        u.edges.value[i] = scale.edges[i + 1];
        u.shades.value[i].set(shade);
      });
    }

    // Sends the buffer that `path.fill` filled.
    send(origin) {
      const {path, mesh} = this;
      if (this.source !== path.buffer) this.allocate();
      // The range was renamed in later releases of the library; pages are built with whichever is installed.
      if (this.shared.updateRange) Object.assign(this.shared.updateRange, {offset: 0, count: path.drawn * 4 * OLP.FLOATS});
      else {
        this.shared.clearUpdateRanges();
        this.shared.addUpdateRange(0, path.drawn * 4 * OLP.FLOATS);
      }
      this.shared.needsUpdate = true;
      mesh.geometry.setDrawRange(0, 6 * path.drawn);
      mesh.position.set(...origin);
    }

    allocate() {
      const {path, mesh} = this,
        room = path.buffer.length / (4 * OLP.FLOATS),
        faces = new Uint32Array(6 * room),
        geometry = new T.BufferGeometry();
      for (let i = 0, o = 0, v = 0; i < room; i++, o += 6, v += 4) faces.set([v, v + 2, v + 1, v + 1, v + 2, v + 3], o);
      geometry.setIndex(new T.BufferAttribute(faces, 1));
      this.shared = new T.InterleavedBuffer(path.buffer, OLP.FLOATS).setUsage(T.DynamicDrawUsage);
      ["a0", "a1", "d0", "d1"].forEach((name, j) =>
        geometry.setAttribute(name, new T.InterleavedBufferAttribute(this.shared, 3, 3 * j)),
      );
      geometry.setAttribute("aux", new T.InterleavedBufferAttribute(this.shared, 4, 12));
      geometry.setAttribute("position", geometry.attributes.a0);
      mesh.geometry.dispose();
      mesh.geometry = geometry;
      this.source = path.buffer;
    }
  }

  OLP.Lines = Lines;
})();
