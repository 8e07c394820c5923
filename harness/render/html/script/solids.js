let graphics = null;

/** Return whether the browser has WebGL, and whether the processor draws it. */
function webgl() {
  if (graphics) return graphics;
  const context = document.createElement("canvas").getContext("webgl2");
  const names = context?.getExtension("WEBGL_debug_renderer_info");
  const name = names ? context.getParameter(names.UNMASKED_RENDERER_WEBGL) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  graphics = { present: Boolean(context), software: /swiftshader|llvmpipe|software/i.test(name) };
  return graphics;
}

/** Load three.js from its pack; null if the page has none, or the browser has no WebGL. */
async function three() {
  if (globalThis.THREE) return THREE;
  if (!document.getElementById("pack-three") || !webgl().present) return null;
  const { code } = await pack("pack-three");
  const script = make("script");
  script.textContent = code;
  document.head.append(script);
  return globalThis.THREE ?? null;
}

/** Forms as geometries of three.js; its cylinders are along y. */
const GEOMETRIES = {
  box: ([a, b, c]) => new THREE.BoxGeometry(2 * a, 2 * b, 2 * c),
  sphere: ([r]) => new THREE.SphereGeometry(r, 20, 12),
  ellipsoid: (half) => new THREE.SphereGeometry(1, 20, 12).scale(...half.map((value) => Math.max(value, 1e-5))),
  cylinder: ([r, h]) => new THREE.CylinderGeometry(r, r, 2 * h, 20).rotateX(Math.PI / 2),
  capsule: ([r, h]) => new THREE.CapsuleGeometry(r, 2 * h, 5, 16).rotateX(Math.PI / 2),
  bone([x, y, z]) {
    const length = Math.hypot(x, y, z);
    const shaft = new THREE.CylinderGeometry(0.02 * length, 0.05 * length, length, 8).translate(0, length / 2, 0);
    const turn = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 1, 0), new THREE.Vector3(x, y, z).normalize());
    return shaft.applyQuaternion(turn);
  },
  mesh(mesh) {
    const { points, faces, normals } = mesh, around = points.map(() => []), geometry = new THREE.BufferGeometry();
    faces.forEach((face, i) => face.forEach((corner) => around[corner].push(i)));
    const shading = faces.flatMap((face, i) => face.flatMap((corner) => around[corner].filter((k) => cosine(normals[i], normals[k]) > 0.75)
      .reduce((sum, k) => sum.map((value, n) => value + normals[k][n]), [0, 0, 0])));
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(faces.flatMap((face) => face.flatMap((corner) => points[corner])), 3));
    geometry.setAttribute("normal", new THREE.Float32BufferAttribute(shading, 3));
    geometry.normalizeNormals();
    return geometry;
  },
};

/** Bodies as shaded solids. */
class Solids {
  constructor(canvas, scene, states, colours) {
    Object.assign(this, { canvas, data: scene, colours, layers: [], geometries: new Map() });
    const fast = !webgl().software;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: fast, alpha: true });
    this.renderer.setPixelRatio(fast ? devicePixelRatio : 1);
    this.camera = new THREE.PerspectiveCamera();
    this.world = new THREE.Scene();
    this.world.add(new THREE.HemisphereLight(0xffffff, 0xaab4bf, 0.8));
    this.light = new THREE.DirectionalLight(0xffffff, 0.35);
    this.world.add(this.light);
    this.ovals = inertias(scene, states).map((one) => this.#inertia(one));
  }

  /** Give the context back, since browsers have few. */
  end() {
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  /** Draw the layers: poses of all bodies, and the tone of each. */
  draw(camera, layers, ovals) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    if (this.size !== `${width} ${height}`) this.renderer.setSize(width, height, false);
    this.size = `${width} ${height}`;
    const field = 2 * Math.atan(Math.tan(FIELD / 2) * Math.max(1, height / width));
    Object.assign(this.camera, { fov: (field * 180) / Math.PI, aspect: width / height, near: 0.01 * camera.radius, far: 100 * camera.radius });
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(...camera.position);
    this.camera.lookAt(...camera.center);
    this.camera.updateProjectionMatrix();
    this.light.position.set(...camera.position).add(new THREE.Vector3(0, 0, camera.distance));
    while (this.layers.length < layers.length) this.layers.push(this.#layer(layers[this.layers.length].ghost));
    const inside = new Set(ovals.map(({ body }) => this.data.bodies[body].joint));
    this.layers.forEach((groups, i) => groups.forEach((group, body) => this.#place(group, layers[i], body, inside)));
    const bodies = new Set(ovals.map(({ body }) => body));
    for (const group of this.ovals) {
      group.visible = bodies.has(group.userData.body);
      this.#pose(group, layers[0].poses[group.userData.body]);
    }
    this.renderer.render(this.world, this.camera);
  }

  /** Return the body at a pixel of the last picture; -1 if there is none. */
  pick(x, y) {
    const { clientWidth: width, clientHeight: height } = this.canvas, ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2((2 * x) / width - 1, 1 - (2 * y) / height), this.camera);
    const [hit] = ray.intersectObjects(this.layers[0] ?? [], true);
    return hit ? this.layers[0].indexOf(hit.object.parent) : -1;
  }

  #pose(group, [x, y, z, w, i, j, k]) {
    group.matrix.compose(new THREE.Vector3(x, y, z), new THREE.Quaternion(i, j, k, w), new THREE.Vector3(1, 1, 1));
  }

  #place(group, layer, body, inside) {
    group.visible = Boolean(layer);
    if (!layer) return;
    this.#pose(group, layer.poses[body]);
    const { material } = group.userData, tone = layer.tone(body);
    material.color.set(this.colours[tone]);
    material.emissive.set(tone === "lit" ? this.colours.lit : "#000000");
    material.emissiveIntensity = 0.35 + 0.25 * layer.glow;
    material.opacity = layer.ghost ? 0.45 : inside.has(this.data.bodies[body].joint) && tone !== "lit" ? 0.5 : 1;
    material.transparent = material.opacity < 1;
    material.depthWrite = !material.transparent;
  }

  /** Create the groups of all bodies for one layer. */
  #layer(ghost) {
    return this.data.bodies.map((_, index) => {
      const group = new THREE.Group();
      group.matrixAutoUpdate = false;
      const material = new THREE.MeshPhongMaterial({ shininess: 25, side: THREE.DoubleSide, polygonOffset: ghost, polygonOffsetFactor: 2, polygonOffsetUnits: 8 });
      for (const form of formsOf(this.data, index)) {
        group.add(this.#solid(form, material));
      }
      group.userData = { material };
      this.world.add(group);
      return group;
    });
  }

  #solid({ kind, size, place: [x, y, z, w, i, j, k] }, material) {
    if (!this.geometries.has(size)) this.geometries.set(size, GEOMETRIES[kind](size));
    const mesh = new THREE.Mesh(this.geometries.get(size), material);
    mesh.position.set(x, y, z);
    mesh.quaternion.set(i, j, k, w);
    return mesh;
  }

  /** Create a group with an engine's inertia as a solid, and that of the equations as lines. */
  #inertia({ body, differs, stated, engine }) {
    const group = new THREE.Group();
    group.matrixAutoUpdate = false;
    group.userData = { body };
    const colour = this.colours[differs ? "lit" : "solid"];
    const material = new THREE.MeshPhongMaterial({ color: colour, emissive: differs ? colour : "#000000", emissiveIntensity: 0.4, shininess: 10, transparent: true, opacity: 0.4, depthWrite: false });
    for (const form of engine) group.add(this.#solid(form, material));
    for (const line of outlines(stated)) {
      const points = new THREE.BufferGeometry().setFromPoints(line.map((point) => new THREE.Vector3(...point)));
      group.add(new THREE.Line(points, new THREE.LineBasicMaterial({ color: this.colours.inertia })));
    }
    this.world.add(group);
    return group;
  }
}
