// Time to draw a relief of 64 x 41 nodes once, ms: median and 95th percentile of `times`, with new heights each time.
// `way` is "own" (the console's painter, on a page of the console) or "three" (three.js as NiceGUI brings it).

async ([way, times]) => {
  const [rows, columns, width, height] = [41, 64, 435, 305];
  const pixels = new Uint8Array(768 * 492);
  const shake = () => {
    for (let at = 0; at < pixels.length; at++) {
      const [x, y] = [(at % 768) - 384, Math.floor(at / 768) - 246];
      pixels[at] = 20 + 180 * Math.exp(-(x * x + y * y) / 14400) + 2 * Math.random();
    }
  };
  const painter = way === "own" ? await own() : await three();
  const took = [];
  for (let time = 0; time < times; time++) {
    shake();
    const begun = performance.now();
    painter(time);
    took.push(performance.now() - begun);
  }
  took.sort((a, b) => a - b);
  return [took[Math.floor(times / 2)], took[Math.floor(0.95 * times)]];

  async function own() {
    const { Relief, blockMeans, colourTable } = await import("tsis-live");
    const relief = new Relief(width, height);
    const grey = Array.from({ length: 256 }, (_, level) => 0xff000000 + level * 0x10101);
    const table = colourTable(grey, [0, 255]);
    const context = Object.assign(document.createElement("canvas"), { width, height }).getContext("2d");
    return (time) => {
      const mesh = blockMeans({ rows: 492, columns: 768, pixels }, columns);
      relief.paint(mesh, { table, azimuth: 0.05 * time, elevation: 0.65, aspect: 0.75, top: 200 });
      context.putImageData(relief.image, 0, 0);
    };
  }

  async function three() {
    const { THREE } = await import("nicegui-scene");
    const renderer = new THREE.WebGLRenderer({ antialias: false });
    renderer.setSize(width, height, false);
    const floor = new THREE.PlaneGeometry(1, 0.75, columns - 1, rows - 1);
    const colours = new THREE.BufferAttribute(new Float32Array(3 * rows * columns).fill(0.5), 3);
    floor.setAttribute("color", colours);
    const scene = new THREE.Scene();
    scene.add(new THREE.Mesh(floor, new THREE.MeshLambertMaterial({ vertexColors: true })));
    scene.add(new THREE.DirectionalLight(0xffffff, 3));
    const camera = new THREE.OrthographicCamera(-0.7, 0.7, 0.5, -0.5, 0.1, 10);
    const drawn = new Uint8Array(4);
    return (time) => {
      const places = floor.attributes.position;
      for (let at = 0; at < rows * columns; at++) {
        const level = pixels[(Math.floor(at / columns) * 12 + 6) * 768 + (at % columns) * 12 + 6];
        places.array[3 * at + 2] = (0.4 * level) / 200;
        colours.array.fill(level / 255, 3 * at, 3 * at + 3);
      }
      places.needsUpdate = colours.needsUpdate = true;
      floor.computeVertexNormals();
      camera.position.set(2 * Math.sin(0.05 * time), -2 * Math.cos(0.05 * time), 1.5);
      camera.up.set(0, 0, 1);
      camera.lookAt(0, 0, 0);
      renderer.render(scene, camera);
      const context = renderer.getContext();
      context.readPixels(0, 0, 1, 1, context.RGBA, context.UNSIGNED_BYTE, drawn); // waits until it is drawn
    };
  }
}
