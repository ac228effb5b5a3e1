"use strict";
// Draws the scene: WebGL, or without it (remote desktops, locked-down computers) a 2-D canvas with the same camera.
(() => {
  const T = MeshCat.THREE,
    FAINT = 0.5; // opacity of what is outside the filter

  // Kind of WebGL: "none", "software" or "hardware".
  OLP.graphics = () => {
    try {
      const context = document.createElement("canvas").getContext("webgl2"),
        named = context.getExtension("WEBGL_debug_renderer_info");
      const name = String(context.getParameter(named?.UNMASKED_RENDERER_WEBGL ?? context.RENDERER));
      context.getExtension("WEBGL_lose_context")?.loseContext();
      return /swiftshader|llvmpipe|software|basic render/i.test(name) ? "software" : "hardware";
    } catch {
      return "none";
    }
  };

  OLP.gl_renderer = (pane, antialias) => {
    const renderer = new T.WebGLRenderer({antialias, alpha: true});
    pane.append(renderer.domElement);
    return renderer;
  };

  // Replaces three's renderer; `draw(context, width, height, ratio)` is set once the scene is there.
  OLP.flat_renderer = pane => {
    const canvas = document.createElement("canvas"),
      context = canvas.getContext("2d");
    let ratio = 1,
      size = [0, 0];
    pane.append(canvas);
    const renderer = {
      domElement: canvas,
      shadowMap: {},
      flat: true,
      draw: null,
      setPixelRatio(value) {
        ratio = value;
        renderer.setSize(...size);
      },
      getPixelRatio: () => ratio,
      setSize(w, h) {
        size = [w, h];
        canvas.width = Math.round(w * ratio);
        canvas.height = Math.round(h * ratio);
        Object.assign(canvas.style, {width: w + "px", height: h + "px"});
      },
      getDrawingBufferSize: target => target.set(canvas.width, canvas.height),
      dispose() {},
      render() {
        renderer.draw?.(context, canvas.width, canvas.height, ratio);
      },
    };
    return renderer;
  };

  // Clip-space projector of (x, y, z) mm to canvas pixels in `out`; false behind the eye.
  function projector(e, w, h, out) {
    return (x, y, z) => {
      const v = e[3] * x + e[7] * y + e[11] * z + e[15];
      if (v < 1e-6) return false;
      out[0] = (((e[0] * x + e[4] * y + e[8] * z + e[12]) / v + 1) / 2) * w;
      out[1] = ((1 - (e[1] * x + e[5] * y + e[9] * z + e[13]) / v) / 2) * h;
      return true;
    };
  }

  // How a segment is stroked: [key, colour, width, dashes, opacity].
  function stroke_of(path, u, value, look) {
    const chosen = look >= OLP.CHOSEN,
      kind = look % OLP.CHOSEN,
      css = c => `#${c.getHexString()}`;
    if (kind === OLP.RAPID) return ["rapid", css(u.faint.value), 1, [5, 4], 1];
    if (kind === OLP.DIM) return ["dim", css(u.faint.value), 1, [], FAINT];
    const count = u.bands.value;
    let band = 0;
    while (band < count - 1 && value > u.edges.value[band]) band++;
    const unknown = count && value !== value,
      colour = unknown ? u.unknown.value : count ? u.shades.value[band] : u.colour.value,
      name = unknown ? "unknown" : count ? band : "plain";
    if (kind === OLP.WHISKER) return [`whisker ${name}`, css(colour), 1, [], FAINT];
    if (chosen) return [`chosen ${name}`, css(colour), path.width + 3, [], 1];
    return [name, css(colour), path.width, path.dashes[1] ? path.dashes : [], 1];
  }

  function draw_path(context, path, u, origin, e, w, h, ratio) {
    const point = [0, 0],
      project = projector(e, w, h, point),
      k = u.k.value,
      b = path.buffer,
      {x: nx, y: ny, z: nz, w: beyond} = u.plane.value,
      strokes = new Map();
    for (let i = 0, o = 0; i < path.drawn; i++, o += 4 * OLP.FLOATS) {
      const look = b[o + 15];
      if (b[o + 14] >= u.cut.value || (look === OLP.RAPID && !u.rapids.value)) continue;
      if (nx * (b[o] + b[o + 3]) + ny * (b[o + 1] + b[o + 4]) + nz * (b[o + 2] + b[o + 5]) > 2 * beyond) continue;
      if (!project(origin[0] + b[o] + k * b[o + 6], origin[1] + b[o + 1] + k * b[o + 7], origin[2] + b[o + 2] + k * b[o + 8]))
        continue;
      const [x, y] = point;
      if (
        !project(origin[0] + b[o + 3] + k * b[o + 9], origin[1] + b[o + 4] + k * b[o + 10], origin[2] + b[o + 5] + k * b[o + 11])
      )
        continue;
      const [key, ...style] = stroke_of(path, u, b[o + 13], look);
      let stroke = strokes.get(key);
      if (!stroke) strokes.set(key, (stroke = {line: new Path2D(), style}));
      stroke.line.moveTo(x, y);
      stroke.line.lineTo(...point);
    }
    const late = key => (String(key).startsWith("chosen") ? 2 : key === "rapid" || key === "dim" ? 0 : 1);
    for (const [, {line, style}] of [...strokes].sort((p, q) => late(p[0]) - late(q[0]))) {
      const [colour, width, dashes, opacity] = style;
      context.strokeStyle = colour;
      context.lineWidth = width * ratio;
      context.globalAlpha = opacity * u.opacity.value;
      context.setLineDash(dashes.map(d => d * ratio));
      context.stroke(line);
    }
    context.setLineDash([]);
    context.globalAlpha = 1;
  }

  // Meshes as their sharp edges.
  function draw_edges(context, mesh, base, w, h, ratio) {
    mesh.userData.edges ??= new T.EdgesGeometry(mesh.geometry, 25).attributes.position.array;
    const edges = mesh.userData.edges,
      point = [0, 0],
      e = new T.Matrix4().multiplyMatrices(base, mesh.matrixWorld).elements,
      project = projector(e, w, h, point);
    context.strokeStyle = `#${mesh.material.color.getHexString()}`;
    context.lineWidth = ratio;
    context.globalAlpha = 0.55;
    context.beginPath();
    for (let i = 0; i + 5 < Math.min(edges.length, 240000); i += 6) {
      if (!project(edges[i], edges[i + 1], edges[i + 2])) continue;
      const [x, y] = point;
      if (!project(edges[i + 3], edges[i + 4], edges[i + 5])) continue;
      context.moveTo(x, y);
      context.lineTo(...point);
    }
    context.stroke();
    context.globalAlpha = 1;
  }

  OLP.flat_drawing = scene => (context, w, h, ratio) => {
    context.setTransform(1, 0, 0, 1, 0, 0);
    context.clearRect(0, 0, w, h);
    const camera = scene.viewer.camera;
    scene.viewer.scene.updateMatrixWorld(true);
    const base = new T.Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    scene.root.traverseVisible(o => {
      if (o.isMesh && o.userData.solid) draw_edges(context, o, base, w, h, ratio);
    });
    const clip = scene.view(0).clip;
    for (const lines of scene.lines.values())
      if (lines.path.visible) draw_path(context, lines.path, lines.uniforms, scene.origin, clip, w, h, ratio);
  };
})();
