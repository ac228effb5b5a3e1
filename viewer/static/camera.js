"use strict";
// Orthographic and perspective camera on the viewer's own controls; standard views that fit the path tightly.
(() => {
  const T = MeshCat.THREE,
    FOV = 30,
    MARGIN = 1.1;
  const LEAST = 0.02; // half height of a view, as a share of the reach of the job
  const KEPT = {left: 24, right: 24, top: 46, bottom: 40}; // px at the edges of the picture that buttons cover
  // Directions from which the six standard views and the isometric one look.
  const VIEWS = {
    iso: [-1, -1.5, 1.05],
    top: [0, -1e-4, 1],
    bottom: [0, -1e-4, -1],
    front: [0, -1, 1e-4],
    back: [0, 1, 1e-4],
    left: [-1, 0, 1e-4],
    right: [1, 0, 1e-4],
  };
  // The viewer turns its scene: machine (x, y, z) mm is world (x, z, -y) m.
  const world = ([x, y, z]) => new T.Vector3(x, z, -y).multiplyScalar(0.001);

  class Camera {
    // box: [low, high] corners (mm) of what a view shows; reach: radius (mm) round its middle that nothing drawn leaves
    constructor(app, box, reach) {
      Object.assign(this, {app, viewer: app.scene.viewer, box, reach});
      this.middle = [0, 1, 2].map(j => (box[0][j] + box[1][j]) / 2);
      this.perspective = new T.PerspectiveCamera(FOV, 1, 0.01, 100);
      this.parallel = new T.OrthographicCamera(-1, 1, 1, -1, 0, 100);
      // Hung below a node that undoes the scene's turn, as the viewer hangs its own.
      for (const [name, camera] of [
        ["parallel", this.parallel],
        ["perspective", this.perspective],
      ]) {
        const path = ["Cameras", name, "rotated"];
        this.viewer.set_transform(path, new T.Matrix4().makeRotationX(Math.PI / 2).toArray());
        this.viewer.set_object(path, camera);
      }
      this.half = 1; // half height of the orthographic view, m
      this.use(this.parallel);
    }

    get ortho() {
      return this.active === this.parallel;
    }
    get aspect() {
      return this.app.scene.pane.clientWidth / Math.max(1, this.app.scene.pane.clientHeight);
    }
    get distance() {
      return this.active.position.distanceTo(this.viewer.controls.target);
    }

    use(camera) {
      const target = this.viewer.controls.target.clone();
      this.viewer.controls.dispose();
      this.active = camera;
      this.viewer.set_camera(camera);
      this.viewer.scene.updateMatrixWorld(true);
      const controls = this.viewer.controls;
      controls.target.copy(target);
      controls.rotateSpeed = 0.8;
      controls.zoomSpeed = 1.2;
      controls.addEventListener("change", () => this.app.scene.moved());
      controls.addEventListener("start", () => this.turned());
      this.resized();
    }

    set_ortho(on) {
      if (on === this.ortho) return;
      const old = this.active,
        target = this.viewer.controls.target.clone(),
        away = old.position.clone().sub(target),
        slope = Math.tan(((FOV / 2) * Math.PI) / 180);
      if (on) {
        this.half = away.length() * slope;
        this.parallel.zoom = 1;
        this.parallel.position.copy(old.position);
      } else this.perspective.position.copy(target).add(away.setLength(this.half / old.zoom / slope));
      this.use(on ? this.parallel : this.perspective);
      this.viewer.controls.target.copy(target);
      this.refresh();
    }

    resized() {
      const aspect = this.aspect;
      this.perspective.aspect = aspect;
      const {clientWidth: w, clientHeight: h} = this.app.scene.pane;
      // What is looked at lies in the middle of what the panels leave free.
      if (w && h)
        for (const camera of [this.perspective, this.parallel])
          camera.setViewOffset(w, h, (KEPT.right - KEPT.left) / 2, (KEPT.bottom - KEPT.top) / 2, w, h);
      Object.assign(this.parallel, {left: -this.half * aspect, right: this.half * aspect, top: this.half, bottom: -this.half});
      this.active.updateProjectionMatrix();
    }

    // Near and far planes close round what there is: depth is scarce.
    clip() {
      const camera = this.active,
        away = camera.position.distanceTo(world(this.middle)),
        reach = this.reach * 0.001;
      camera.near = this.ortho ? away - reach : Math.max(away - reach, this.distance / 300);
      camera.far = away + reach;
      camera.updateProjectionMatrix();
    }

    refresh() {
      this.viewer.controls.update();
      this.clip();
      this.resized();
      this.app.scene.refill();
    }

    // Shows a box, by default that of the job, from a named direction or from the present one.
    fit(name = null, box = this.box) {
      const controls = this.viewer.controls,
        target = world([0, 1, 2].map(j => (box[0][j] + box[1][j]) / 2));
      const from = name ? world(VIEWS[name]).normalize() : this.active.position.clone().sub(controls.target).normalize();
      const right = new T.Vector3().crossVectors(new T.Vector3(0, 1, 0), from).normalize(),
        up = new T.Vector3().crossVectors(from, right);
      let wide = 0,
        high = 0,
        deep = 0;
      for (let corner = 0; corner < 8; corner++) {
        const offset = world([0, 1, 2].map(j => box[(corner >> j) & 1][j])).sub(target);
        wide = Math.max(wide, Math.abs(offset.dot(right)));
        high = Math.max(high, Math.abs(offset.dot(up)));
        deep = Math.max(deep, Math.abs(offset.dot(from)));
      }
      const {clientWidth: w, clientHeight: h} = this.app.scene.pane,
        free = [w - KEPT.left - KEPT.right, h - KEPT.top - KEPT.bottom].map(v => Math.max(v, h / 4));
      this.half = Math.max((high * h) / free[1], (wide * h) / free[0], LEAST * this.reach * 0.001) * MARGIN;
      this.parallel.zoom = 1;
      const distance = this.half / Math.tan(((FOV / 2) * Math.PI) / 180) + deep;
      this.active.position.copy(target).addScaledVector(from, distance);
      controls.target.copy(target);
      this.refresh();
    }

    // The view is none of the standard ones any more.
    turned() {
      this.app.state.view = "";
      OLP.emit("view");
    }

    // Turns by angles (rad) about the vertical and the horizontal of the view, and comes nearer by a factor.
    turn(about, over, nearer = 1) {
      const controls = this.viewer.controls,
        away = this.active.position.clone().sub(controls.target),
        polar = new T.Spherical().setFromVector3(away);
      polar.theta += about;
      polar.phi = Math.min(Math.PI - 1e-3, Math.max(1e-3, polar.phi + over));
      if (this.ortho) this.parallel.zoom *= nearer;
      else polar.radius /= nearer;
      this.active.position.copy(controls.target).add(away.setFromSpherical(polar));
      this.turned();
      this.refresh();
    }

    // Brings a point (mm) into view without turning the camera, if it is outside.
    reveal(point) {
      const [x, y] = this.app.scene.project(point) ?? [-1, -1],
        {clientWidth: w, clientHeight: h} = this.app.scene.pane;
      if (x > 0.04 * w && x < 0.96 * w && y > 0.04 * h && y < 0.96 * h) return;
      const controls = this.viewer.controls,
        move = world(point).sub(controls.target);
      controls.target.add(move);
      this.active.position.add(move);
      this.refresh();
    }

    target_mm() {
      const {x, y, z} = this.viewer.controls.target;
      return [1000 * x, -1000 * z, 1000 * y];
    }

    save() {
      return {
        ortho: this.ortho,
        position: this.active.position.toArray(),
        target: this.viewer.controls.target.toArray(),
        half: this.half,
        zoom: this.parallel.zoom,
      };
    }

    // A camera from an address; one that cannot be is left out.
    restore({ortho, position, target, half, zoom}) {
      const three = v => Array.isArray(v) && v.length === 3 && v.every(Number.isFinite);
      if (!three(position) || !three(target) || ![half, zoom].every(v => Number.isFinite(v) && v > 0) || position.every((v, j) => v === target[j])) return;
      ortho = Boolean(ortho);
      if (ortho !== this.ortho) this.use(ortho ? this.parallel : this.perspective);
      this.half = half;
      this.parallel.zoom = zoom;
      this.active.position.fromArray(position);
      this.viewer.controls.target.fromArray(target);
      this.refresh();
      this.app.state.view = "";
      document.getElementById("ortho").setAttribute("aria-pressed", this.ortho);
    }

    // Unit vectors of the machine axes on the screen (x right, y down).
    axes() {
      const e = this.active.matrixWorldInverse.elements;
      return [
        [1, 0, 0],
        [0, 0, -1],
        [0, 1, 0],
      ].map(([x, y, z]) => [e[0] * x + e[4] * y + e[8] * z, -(e[1] * x + e[5] * y + e[9] * z), e[2] * x + e[6] * y + e[10] * z]);
    }
  }

  OLP.Camera = Camera;
  OLP.VIEWS = Object.keys(VIEWS);
})();
