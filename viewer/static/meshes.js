"use strict";
// Workpiece, fixture and machine; nodes that follow the axes; the tool.
(() => {
  const T = MeshCat.THREE;

  const MOST_EDGED = 300000; // corners of faces; edges of finer meshes are noise

  const FAINT = 0.13; // opacity of the machine, which is in front of the path

  // Faces with separate corners, so that each has its own normal.
  function flat(vertices, faces) {
    const geometry = new T.BufferGeometry(),
      corners = new Float32Array(3 * faces.length);
    for (let i = 0; i < faces.length; i++) for (let j = 0; j < 3; j++) corners[3 * i + j] = vertices[3 * faces[i] + j];
    geometry.setAttribute("position", new T.BufferAttribute(corners, 3));
    geometry.computeVertexNormals();
    return geometry;
  }

  // Sharp edges: they show the shape of transparent bodies.
  function edges(geometry, {colour, opacity}) {
    const lines = new T.LineSegments(
      new T.EdgesGeometry(geometry, 25),
      new T.LineBasicMaterial({color: colour, transparent: true, opacity: Math.min(1, opacity + 0.3), depthWrite: false}),
    );
    lines.renderOrder = 1;
    return lines;
  }

  class Meshes {
    constructor(app) {
      this.app = app;
      const {manifest, arrays, scene} = app;
      this.shown = {};
      this.reach = [];
      for (const mesh of manifest.meshes ?? []) {
        const geometry = flat(arrays.get(mesh.vertices), arrays.get(mesh.faces));
        const opacity = mesh.role === "machine" ? Math.min(mesh.opacity, FAINT) : mesh.opacity,
          clear = opacity < 1;
        // Pushed back a little, so that paths on a face are in front of it. Lit by corner, and transparent bodies from the
        // front only: large transparent faces cost software GL most.
        const material = new T.MeshLambertMaterial({
          color: mesh.colour,
          transparent: clear,
          opacity,
          side: clear ? T.FrontSide : T.DoubleSide,
          depthWrite: !clear,
          polygonOffset: true,
          polygonOffsetFactor: 1,
          polygonOffsetUnits: 2,
        });
        const object = new T.Mesh(geometry, material);
        object.userData.solid = true;
        object.renderOrder = clear ? 1 : 0;
        if (geometry.attributes.position.count < MOST_EDGED) object.add(edges(geometry, mesh));
        const role = mesh.role;
        scene.viewer.set_object(["olp", ...(mesh.path?.length ? mesh.path : [role]), "mesh-" + mesh.name], object);
        (this.shown[role] ??= {objects: [], labels: [], visible: true}).objects.push(object);
        this.shown[role].labels.push(mesh.label);
        geometry.computeBoundingSphere();
        this.reach.push([geometry.boundingSphere.center.toArray(), geometry.boundingSphere.radius]);
      }
      if (!this.shown.tool) this.draw_tool(manifest.tool_radius_mm || 1);
      this.nodes =
        manifest.axes && arrays.has(manifest.axes)
          ? (manifest.nodes ?? []).map(n => ({
              ...n,
              direction: new T.Vector3(...n.direction),
              point: new T.Vector3(...n.point_mm.map((v, j) => v - manifest.origin_mm[j])),
              object: scene.viewer.scene_tree.find(["olp", ...n.path]).object,
            }))
          : [];
    }

    // A ball and a shank where the file has no mesh of the tool.
    draw_tool(radius) {
      const {viewer} = this.app.scene,
        objects = [];
      const parts = [
        new T.SphereGeometry(radius, 20, 12),
        new T.CylinderGeometry(radius * 0.6, radius * 0.6, radius * 6, 20).rotateX(Math.PI / 2).translate(0, 0, radius * 3),
      ];
      parts.forEach((geometry, i) => {
        const object = new T.Mesh(geometry, new T.MeshLambertMaterial({color: "#c8a24a", transparent: true, opacity: 0.4}));
        object.userData.solid = true;
        viewer.set_object(["olp", "tool", `part-${i}`], object);
        objects.push(object);
      });
      this.shown.tool = {objects, labels: ["Tool"], visible: true};
    }

    set_visible(role, on) {
      this.shown[role].visible = on;
      for (const object of this.shown[role].objects) object.visible = on;
      this.app.scene.viewer.set_dirty();
    }

    // Tool to the point (mm); machine to the axis positions at the sample (may be between two).
    follow(point, sample) {
      this.app.scene.viewer.scene_tree.find(["olp", "tool"]).object.position.set(...point);
      if (!this.nodes.length) return;
      const Q = this.app.arrays.get(this.app.manifest.axes),
        columns = this.app.manifest.axes_origin.length,
        n = Q.length / columns,
        i = Math.min(n - 1, Math.floor(sample)),
        j = Math.min(n - 1, i + 1);
      for (const {axis, kind, direction, point, object} of this.nodes) {
        const from = Q[columns * i + axis],
          value = from + (sample - i) * (Q[columns * j + axis] - from);
        if (kind === "linear") object.position.copy(direction).multiplyScalar(value);
        else {
          // about a line: what is on it stays
          object.quaternion.setFromAxisAngle(direction, (value * Math.PI) / 180);
          object.position.copy(point).sub(point.clone().applyQuaternion(object.quaternion));
        }
      }
    }
  }

  OLP.Meshes = Meshes;
})();
