/** Return a canvas with a context for solids, and whether the processor draws it; null without WebGL. */
function graphics(canvas) {
  const open = (on, antialias) => on.getContext("webgl2", { alpha: true, antialias });
  const context = open(canvas, false), names = context?.getExtension("WEBGL_debug_renderer_info");
  const name = names ? context.getParameter(names.UNMASKED_RENDERER_WEBGL) : "";
  if (!context || /swiftshader|llvmpipe|software/i.test(name)) return context && { canvas, context, software: true };
  // Smooth edges cost a graphics card nothing, and need another context.
  const smooth = canvas.cloneNode();
  context.getExtension("WEBGL_lose_context")?.loseContext();
  return { canvas: smooth, context: open(smooth, true), software: false };
}

/** Load three.js from its pack; null if the page has none. */
async function three() {
  if (globalThis.THREE || !document.getElementById("pack-three")) return globalThis.THREE ?? null;
  const { code } = await pack("pack-three");
  const script = make("script");
  script.textContent = code;
  document.head.append(script);
  return globalThis.THREE ?? null;
}

/** Forms as geometries of three.js; its cylinders are along y. */
const GEOMETRIES = {
  box: ([a, b, c]) => new THREE.BoxGeometry(2 * a, 2 * b, 2 * c),
  sphere: ([r]) => new THREE.SphereGeometry(r, 14, 8),
  ellipsoid: (half) => new THREE.SphereGeometry(1, 14, 8).scale(...half.map((value) => Math.max(value, 1e-5))),
  cylinder: ([r, h]) => new THREE.CylinderGeometry(r, r, 2 * h, 20).rotateX(Math.PI / 2),
  capsule: ([r, h]) => new THREE.CapsuleGeometry(r, 2 * h, 2, 12).rotateX(Math.PI / 2),
  bone([x, y, z]) {
    const length = Math.hypot(x, y, z);
    const shaft = new THREE.CylinderGeometry(0.02 * length, 0.05 * length, length, 8).translate(0, length / 2, 0);
    const turn = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 1, 0), new THREE.Vector3(x, y, z).normalize());
    return shaft.applyQuaternion(turn);
  },
  mesh(mesh) {
    const { points, faces, normals } = mesh, around = points.map(() => []), geometry = new THREE.BufferGeometry();
    faces.forEach((face, i) => { for (const corner of face) around[corner].push(i); });
    const units = normals.map(([x, y, z]) => { const size = Math.sqrt(x * x + y * y + z * z) || 1; return [x / size, y / size, z / size]; });
    // A vertex for each point and normal: where the surface is smooth, faces share them.
    const vertices = points.map(() => []), positions = [], shading = [], corners = [];
    faces.forEach((face, i) => {
      for (const point of face) {
        let x = 0, y = 0, z = 0;
        for (const k of around[point]) if (dot(units[i], units[k]) > 0.75) [x, y, z] = [x + normals[k][0], y + normals[k][1], z + normals[k][2]];
        let vertex = vertices[point].find((one) => shading[3 * one] === x && shading[3 * one + 1] === y && shading[3 * one + 2] === z);
        if (vertex === undefined) {
          vertex = positions.length / 3;
          vertices[point].push(vertex);
          positions.push(...points[point]);
          shading.push(x, y, z);
        }
        corners.push(vertex);
      }
    });
    geometry.setIndex(corners);
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(positions, 3));
    geometry.setAttribute("normal", new THREE.Float32BufferAttribute(shading, 3));
    geometry.normalizeNormals();
    return geometry;
  },
};

/** Pixels of a moving picture per pixel of the page, where the processor draws. */
const COARSE = 0.5;

/** Bodies as shaded solids. */
class Solids {
  constructor(scene, states, colours, { canvas, context, software }) {
    Object.assign(this, { canvas, data: scene, layers: [], geometries: new Map(), software });
    this.colours = Object.fromEntries(Object.entries(colours).map(([tone, colour]) => [tone, new THREE.Color(colour)]));
    this.renderer = new THREE.WebGLRenderer({ canvas, context, alpha: true });
    this.renderer.debug.checkShaderErrors = false; // which waits for the compiler
    this.camera = new THREE.PerspectiveCamera();
    this.world = new THREE.Scene();
    this.world.add(new THREE.HemisphereLight(0xffffff, 0xaab4bf, 0.8));
    this.light = new THREE.DirectionalLight(0xffffff, 0.35);
    this.world.add(this.light);
    this.inertias = inertias(scene, states);
  }

  /** Give the context back, since browsers have few. */
  end() {
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  /** Draw the layers: poses of all bodies, and the tone of each; coarser in motion by software. */
  draw(camera, layers, ovals, moving) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    const ratio = this.software ? (moving ? COARSE : 1) : Math.min(devicePixelRatio, 2);
    if (this.size !== `${width} ${height} ${ratio}`) {
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(width, height, false);
    }
    this.size = `${width} ${height} ${ratio}`;
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
    if (ovals.length) this.ovals ??= this.inertias.map((one) => this.#inertia(one));
    for (const group of this.ovals ?? []) {
      group.visible = bodies.has(group.userData.body);
      this.#pose(group, layers[0].poses[group.userData.body]);
    }
    this.renderer.render(this.world, this.camera);
  }

  /** Show or hide a floor and axes, as lines with tones. */
  floor(lines, visible) {
    if (!this.ground) {
      this.ground = new THREE.Group();
      for (const tone of new Set(lines.map((one) => one.tone))) {
        const points = lines.filter((one) => one.tone === tone).flatMap(({ line }) => line.map((point) => new THREE.Vector3(...point)));
        this.ground.add(new THREE.LineSegments(new THREE.BufferGeometry().setFromPoints(points), new THREE.LineBasicMaterial({ color: this.colours[tone] })));
      }
      this.world.add(this.ground);
    }
    this.ground.visible = visible;
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
    const { material } = group.userData, tone = layer?.tone(body);
    group.visible = Boolean(tone);
    if (!tone) return;
    this.#pose(group, layer.poses[body]);
    material.color.copy(this.colours[tone]);
    if (tone === "lit") material.emissive.copy(this.colours.lit); else material.emissive.set(0);
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
      const forms = formsOf(this.data, index), side = forms.some(({ kind }) => kind === "mesh") ? THREE.DoubleSide : THREE.FrontSide;
      const material = new THREE.MeshLambertMaterial({ side, polygonOffset: ghost, polygonOffsetFactor: 2, polygonOffsetUnits: 8 });
      for (const form of forms) group.add(this.#solid(form, material));
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
    mesh.updateMatrix();
    mesh.matrixAutoUpdate = false;
    return mesh;
  }

  /** Create a group with an engine's inertia as a solid, and that of the equations as lines. */
  #inertia({ body, differs, stated, engine }) {
    const group = new THREE.Group();
    group.matrixAutoUpdate = false;
    group.userData = { body };
    const colour = this.colours[differs ? "lit" : "solid"];
    const material = new THREE.MeshLambertMaterial({ color: colour, emissive: differs ? colour : 0, emissiveIntensity: 0.4, transparent: true, opacity: 0.4, depthWrite: false });
    for (const form of engine) group.add(this.#solid(form, material));
    for (const line of outlines(stated)) {
      const points = new THREE.BufferGeometry().setFromPoints(line.map((point) => new THREE.Vector3(...point)));
      group.add(new THREE.Line(points, new THREE.LineBasicMaterial({ color: this.colours.inertia })));
    }
    this.world.add(group);
    return group;
  }
}
