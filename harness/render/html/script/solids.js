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
};

/** Bodies as shaded solids. */
class Solids {
  constructor(canvas, scene, colours) {
    Object.assign(this, { canvas, data: scene, colours, layers: [] });
    const fast = !webgl().software;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: fast, alpha: true });
    this.renderer.setPixelRatio(fast ? devicePixelRatio : 1);
    this.camera = new THREE.PerspectiveCamera();
    this.world = new THREE.Scene();
    this.world.add(new THREE.HemisphereLight(0xffffff, 0xaab4bf, 0.8));
    this.light = new THREE.DirectionalLight(0xffffff, 0.35);
    this.world.add(this.light);
  }

  /** Give the context back, since browsers have few. */
  end() {
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  /** Draw the layers: poses of all bodies, and the tone of each. */
  draw(camera, layers, inertia) {
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
    this.layers.forEach((groups, i) => groups.forEach((group, body) => this.#place(group, layers[i], body, inertia)));
    this.renderer.render(this.world, this.camera);
  }

  #place(group, layer, body, inertia) {
    group.visible = Boolean(layer);
    if (!layer) return;
    const [x, y, z, w, i, j, k] = layer.poses[body];
    group.matrix.compose(new THREE.Vector3(x, y, z), new THREE.Quaternion(i, j, k, w), new THREE.Vector3(1, 1, 1));
    const { material, wires } = group.userData, tone = layer.tone(body);
    material.color.set(this.colours[tone]);
    material.emissive.set(tone === "lit" ? this.colours.lit : "#000000");
    material.emissiveIntensity = 0.35 + 0.25 * layer.glow;
    material.opacity = layer.ghost ? 0.45 : inertia ? 0.35 : 1;
    material.transparent = material.opacity < 1;
    material.depthWrite = !material.transparent;
    wires.visible = inertia && !layer.ghost;
  }

  /** Create the groups of all bodies for one layer. */
  #layer(ghost) {
    return this.data.bodies.map((body, index) => {
      const group = new THREE.Group();
      group.matrixAutoUpdate = false;
      const material = new THREE.MeshPhongMaterial({ shininess: 25, side: THREE.DoubleSide, polygonOffset: ghost, polygonOffsetFactor: 2, polygonOffsetUnits: 8 });
      for (const form of formsOf(this.data, index)) {
        const mesh = new THREE.Mesh(GEOMETRIES[form.kind](form.size), material);
        const [x, y, z, w, i, j, k] = form.place;
        mesh.position.set(x, y, z);
        mesh.quaternion.set(i, j, k, w);
        group.add(mesh);
      }
      const wires = new THREE.Group();
      for (const line of ghost ? [] : outlines(inertiaOf(body))) {
        const points = new THREE.BufferGeometry().setFromPoints(line.map((point) => new THREE.Vector3(...point)));
        wires.add(new THREE.Line(points, new THREE.LineBasicMaterial({ color: this.colours.inertia })));
      }
      group.add(wires);
      group.userData = { material, wires };
      this.world.add(group);
      return group;
    });
  }
}
