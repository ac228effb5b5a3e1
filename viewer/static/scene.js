"use strict";
// MeshCat's viewer with the paths in it: what is drawn, when, and the pixel of a point.
(() => {
  const T = MeshCat.THREE,
    MM = 0.001; // the viewer's scene is in metres
  const BUDGET = {start: {hardware: 200000, software: 25000, none: 45000}, least: 20000, most: 400000, slow: 140, fast: 40}; // segments of all layers; ms of a frame
  const MOVING = 0.5; // pixels each way while the view moves, where a frame is not fast

  class Scene {
    constructor(app, pane) {
      this.app = app;
      this.pane = pane;
      const graphics = OLP.graphics();
      this.viewer = new MeshCat.Viewer(
        pane,
        false, // draws from `begin` on
        graphics === "none" ? OLP.flat_renderer(pane) : OLP.gl_renderer(pane, graphics === "hardware"),
      );
      this.flat = Boolean(this.viewer.renderer.flat);
      this.viewer.gui.domElement.hidden = true; // its scene tree still writes to it
      this.viewer.set_property(["Background"], "visible", false); // the page's own background shows through, at no cost
      window.onload = null; // the viewer sets it, to size itself by the window
      for (const path of [["Grid"], ["Axes"], ["Lights", "PointLightNegativeX"], ["Lights", "PointLightPositiveX"]])
        this.viewer.set_property(path, "visible", false);
      const light = new T.DirectionalLight(0xffffff, 0.55);
      light.position.set(1, -2, 3);
      this.viewer.set_object(["Lights", "olp"], light);
      this.viewer.set_property(["olp"], "scale", [MM, MM, MM]);
      this.root = this.viewer.scene_tree.find(["olp"]).object;
      this.lines = new Map();
      this.origin = [0, 0, 0];
      this.budget = BUDGET.start[graphics];
      this.ms = 0; // that the last frame took that was measured
      this.begun = false;
      this.plane = null; // of the section: [x, y, z, distance], mm; what is beyond is left out
      this.size_by_pane();
      const render = this.viewer.render;
      this.viewer.render = () => {
        this.app.camera?.clip();
        const start = performance.now();
        render.call(this.viewer);
        if (this.refilled) this.adapt(start);
        OLP.emit("drawn");
      };
    }

    // The viewer sizes itself by the window's height: wrong for a pane.
    size_by_pane() {
      const resize = this.viewer.set_3d_pane_size;
      this.viewer.set_3d_pane_size = () => {
        const {clientWidth: w, clientHeight: h} = this.pane,
          {x, y} = this.size ?? {};
        if (!w || !h || (x === w && y === h)) return;
        this.size = {x: w, y: h};
        resize.call(this.viewer, w, h);
        this.app.camera?.resized();
        for (const {uniforms} of this.lines.values()) uniforms.size.value.set(w, h);
        this.sharpen(1);
        this.schedule(60);
      };
      new ResizeObserver(() => this.viewer.set_3d_pane_size()).observe(this.pane);
    }

    // Draws the first picture, and from then on what has changed.
    begin() {
      this.begun = true;
      this.refill();
      this.viewer.render();
      this.viewer.animate();
    }

    // Draws a share of the pixels of the screen each way.
    sharpen(share) {
      const {renderer} = this.viewer,
        ratio = (window.devicePixelRatio || 1) * share;
      for (const {uniforms} of this.lines.values()) uniforms.ratio.value = ratio;
      if (renderer.getPixelRatio() === ratio) return;
      renderer.setPixelRatio(ratio);
      this.viewer.set_dirty();
    }

    // The view moves: fewer pixels until it rests.
    moved() {
      if (!this.begun) return;
      if (!this.flat && this.ms > BUDGET.fast) this.sharpen(MOVING);
      this.schedule(120);
    }

    add_path(path, order) {
      const lines = new OLP.Lines(path, order);
      this.lines.set(path.name, lines);
      this.viewer.set_object(["olp", path.name], lines.mesh);
      this.viewer.set_property(["olp", path.name], "visible", path.visible);
    }

    set_uniform(name, value) {
      for (const {uniforms} of this.lines.values()) uniforms[name].value = value;
      this.viewer.set_dirty();
    }

    // Leaves out what is beyond a plane, or with null nothing.
    set_plane(plane) {
      this.plane = plane;
      const far = plane && new T.Plane(new T.Vector3(-plane[0], -plane[1], -plane[2]), plane[3] * MM);
      if (far) far.applyMatrix4(new T.Matrix4().makeRotationX(-Math.PI / 2));
      this.viewer.renderer.localClippingEnabled = Boolean(plane);
      this.root.traverse(o => {
        if (o.material && !o.material.uniforms) o.material.clippingPlanes = far ? [far] : null;
      });
      this.place_plane();
    }

    // The plane in the coordinates of the buffers, which are about `origin`.
    place_plane() {
      const [x, y, z, w] = this.plane ?? [0, 0, 0, 1],
        [a, b, c] = this.origin;
      for (const {uniforms} of this.lines.values()) uniforms.plane.value.set(x, y, z, w - x * a - y * b - z * c);
      this.viewer.set_dirty();
    }

    // What is drawn now, as a picture of its own: the drawing buffer is not kept after a frame.
    still() {
      this.sharpen(1);
      this.viewer.render();
      const source = this.viewer.renderer.domElement,
        copy = Object.assign(document.createElement("canvas"), {width: source.width, height: source.height});
      copy.getContext("2d").drawImage(source, 0, 0);
      return copy;
    }

    // The projection of a point (mm) to the pane: clip matrix, pane size, px per (mm / depth), exaggeration.
    view(k) {
      const camera = this.viewer.camera,
        {clientWidth: w, clientHeight: h} = this.pane;
      this.root.updateWorldMatrix(true, false);
      camera.updateMatrixWorld();
      const clip = new T.Matrix4()
        .multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse)
        .multiply(this.root.matrixWorld).elements;
      return {
        clip,
        w,
        h,
        k,
        scale: ((camera.projectionMatrix.elements[5] * h) / 2) * MM,
        ortho: Boolean(camera.isOrthographicCamera),
      };
    }

    // Pixel of the pane of a point (mm), or null behind the eye.
    project([x, y, z], {clip: e, w, h} = this.view(0)) {
      const v = e[3] * x + e[7] * y + e[11] * z + e[15];
      if (v < 1e-6) return null;
      return [
        (((e[0] * x + e[4] * y + e[8] * z + e[12]) / v + 1) / 2) * w,
        ((1 - (e[1] * x + e[5] * y + e[9] * z + e[13]) / v) / 2) * h,
      ];
    }

    // Nearest point on a drawn path to a pixel of the pane; of equal ones that of the upper layer.
    pick(x, y, limit = 8) {
      let best = null;
      for (const lines of [...this.lines.values()].reverse()) {
        const {path, uniforms: u} = lines;
        if (!path.visible || u.opacity.value < 0.3) continue;
        const hit = path.pick(this.view(u.k.value), x, y, best ? best.distance - 0.25 : limit, u.cut.value, u.rapids.value > 0.5, this.plane);
        if (hit) best = hit;
        if (best && best.distance <= 0.25) break;
      }
      return best;
    }

    schedule(ms = 120) {
      clearTimeout(this.timer);
      if (!this.begun) return;
      this.timer = setTimeout(() => this.refill(), ms);
    }

    // Chooses again which part of each path is drawn, for the current camera.
    refill() {
      clearTimeout(this.timer);
      if (!this.pane.clientWidth || !this.begun) return;
      this.sharpen(1);
      this.origin = this.app.camera.target_mm();
      const shown = [...this.lines.values()].filter(l => l.path.visible);
      const wanted = shown.map(l => l.path.demand(this.view(l.uniforms.k.value))),
        all = wanted.reduce((a, b) => a + b, 0);
      const {ortho, scale} = this.view(0),
        px = ortho ? scale : scale / this.app.camera.distance; // of a mm at the target
      shown.forEach((lines, i) => {
        const cap = Math.max(256, all > this.budget ? Math.floor((this.budget * wanted[i]) / all) : Math.ceil(wanted[i] * 1.1));
        const apart = this.app.state.layers.whiskers && lines.path.D ? lines.path.apart(px) : 0;
        lines.path.fill(cap, wanted[i], this.origin, apart);
        lines.send(this.origin);
      });
      this.place_plane();
      this.refilled = true;
      this.viewer.set_dirty();
    }

    // Spends more segments where the computer draws them quickly, fewer where it does not.
    adapt(start) {
      this.refilled = false;
      const thinned = [...this.lines.values()].some(l => l.path.visible && l.path.thin > 1);
      this.finish();
      const ms = (this.ms = performance.now() - start);
      if (ms > BUDGET.slow && thinned && this.budget > BUDGET.least) this.budget = Math.max(BUDGET.least, this.budget * 0.75);
      else if (ms < BUDGET.fast && thinned && this.budget < BUDGET.most) this.budget = Math.min(BUDGET.most, this.budget * 1.6);
    }

    // Waits until the picture is drawn.
    finish() {
      if (this.flat) return;
      const gl = this.viewer.renderer.getContext();
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    }

    frame_ms() {
      const start = performance.now();
      this.viewer.render();
      this.finish();
      return performance.now() - start;
    }

    get drawn() {
      return Object.fromEntries([...this.lines].map(([name, {path}]) => [name, path.visible ? path.drawn : 0]));
    }
  }

  OLP.Scene = Scene;
})();
