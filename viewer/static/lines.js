"use strict";
// Wide screen-space lines as expanded quads: in software GL several times faster than instanced ones.
(() => {
  const T = MeshCat.THREE;
  const VERTEX = `
in vec3 a0, a1, d0, d1;
in vec4 aux;                        // side (-1, 1 at the start; -2, 2 at the end), value, sample, kind
uniform mat4 whole;                 // from mm to the clip space, multiplied in double precision
uniform vec2 size;                  // of the pane, px
uniform float width, k, low, high, cut, first, last, lift, coloured, rapids;
uniform vec3 colour, faint, accent;
uniform sampler2D colours;
flat out vec3 shade;
flat out vec2 style;                // dashes along x (1) or y (2) or none (0); half width, px
out float across;                   // px from the middle line
const float ENTRIES = ${OLP.colour.SIZE}.0;
vec3 coded(float value) {
  float at = value != value ? ENTRIES : clamp((value - low) / (high - low), 0.0, 1.0) * (ENTRIES - 1.0);
  return texelFetch(colours, ivec2(int(at + 0.5), 0), 0).rgb;
}
float lifted(vec4 clip) { // depth as if it were some pixels nearer: later layers lie above earlier ones
  float nearer = lift * 2.0 / (projectionMatrix[1][1] * size.y) * clip.w;
  return (clip.z + projectionMatrix[2][2] * nearer) / (clip.w + projectionMatrix[2][3] * nearer) * clip.w;
}
void main() {
  vec4 p = whole * vec4(a0 + k * d0, 1.0), q = whole * vec4(a1 + k * d1, 1.0);
  bool rapid = aux.w > 0.5;
  if ((p.w < 1e-5 && q.w < 1e-5) || aux.z >= cut || (rapid && rapids < 0.5)) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); return; }
  if (p.w < 1e-5) p = mix(q, p, (q.w - 1e-5) / (q.w - p.w));
  if (q.w < 1e-5) q = mix(p, q, (p.w - 1e-5) / (p.w - q.w));
  vec2 dir = (q.xy / q.w - p.xy / p.w) * size;
  float span = length(dir);
  dir = span < 1e-6 ? vec2(1.0, 0.0) : dir / span;
  bool end = abs(aux.x) > 1.5, chosen = aux.z >= first && aux.z < last;
  float wide = chosen ? max(width, 2.0) + 3.0 : rapid ? 1.2 : width;
  vec4 r = end ? q : p;
  r.z = lifted(r);
  across = sign(aux.x) * (wide * 0.5 + 0.75);
  r.xy += (vec2(-dir.y, dir.x) * across * 2.0 + dir * (end ? 0.5 : -0.5) * wide) / size * r.w;
  gl_Position = r;
  style = vec2(rapid && !chosen ? (abs(dir.x) > abs(dir.y) ? 1.0 : 2.0) : 0.0, wide * 0.5);
  vec3 c = rapid ? faint : coloured > 0.5 ? coded(aux.y) : colour;
  shade = chosen ? mix(accent, c, coloured * 0.25) : c;
}`;
  // Edges fade over a pixel: smooth without multisampling, which would double the time of software GL. Dashes counted
  // along the longer screen axis join up over any number of short segments.
  const FRAGMENT = `
uniform float ratio;
flat in vec3 shade;
flat in vec2 style;
in float across;
out vec4 result;
void main() {
  float alpha = clamp(style.y + 0.5 - abs(across), 0.0, 1.0);
  if (alpha <= 0.0 || (style.x > 0.5 && mod(style.x > 1.5 ? gl_FragCoord.y : gl_FragCoord.x, 9.0 * ratio) > 5.0 * ratio)) discard;
  result = vec4(shade, alpha);
  gl_FragDepth = gl_FragCoord.z + 0.02 * (1.0 - alpha);   // a faint edge must not hide the line behind it
}`;

  class Lines {
    constructor(path, order, colours) {
      this.path = path;
      const u = (this.uniforms = {});
      const start = {
        size: new T.Vector2(1, 1),
        width: path.width,
        k: 0,
        low: 0,
        high: 1,
        cut: 1e9,
        first: -1,
        last: -1,
        lift: 1.5 + 1.5 * order,
        coloured: 0,
        rapids: 1,
        ratio: 1,
        whole: new T.Matrix4(),
        colour: new T.Color(path.colour),
        faint: new T.Color("#999999"),
        accent: new T.Color("#ffb000"),
        colours,
      };
      for (const [name, value] of Object.entries(start)) u[name] = {value};
      this.material = new T.ShaderMaterial({
        glslVersion: T.GLSL3,
        vertexShader: VERTEX,
        fragmentShader: FRAGMENT,
        uniforms: u,
        side: T.DoubleSide,
        transparent: true,
      });
      this.mesh = new T.Mesh(new T.BufferGeometry(), this.material);
      this.mesh.frustumCulled = false;
      this.mesh.onBeforeRender = (renderer, scene, camera) =>
        u.whole.value.multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse).multiply(this.mesh.matrixWorld);
      this.mesh.renderOrder = 10 + order;
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
