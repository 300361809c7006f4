// The viewers, each in a page of its own: opens a file with a camera, and draws it on and on.
//
// A camera has eye, target and up in the axes and units of the file, and the field of view from the upper to the lower
// edge in degrees. The canvas is 512 x 512 pixels, on black. Options are those of the viewer where nothing is said.

const SIZE = 512;
const distance = ({ eye, target }) => Math.hypot(...eye.map((v, k) => v - target[k]));

function place(three, { eye, target, up, fov }) {
    const far = distance({ eye, target });
    const camera = new three.PerspectiveCamera(fov, 1, far / 10, far * 10);
    camera.position.set(...eye);
    camera.up.set(...up);
    camera.lookAt(...target);
    camera.updateMatrixWorld();
    return camera;
}

function canvas() {
    const element = document.createElement('canvas');
    element.width = element.height = SIZE;
    document.body.append(element);
    return element;
}

const VIEWERS = {
    /** three.js' own splats, an addon of its WebGPU renderer, here over WebGL. */
    async three(url, kind, view, { linear }) {
        const three = await import('three');
        const { GaussianSplat } = await import('three/addons/objects/GaussianSplat.js');
        const renderer = new three.WebGPURenderer({ canvas: canvas(), forceWebGL: true });
        if (linear) renderer.outputColorSpace = three.LinearSRGBColorSpace;
        await renderer.init();
        renderer.setSize(SIZE, SIZE);
        const scene = new three.Scene();
        scene.background = new three.Color(0);
        if (kind === 'glb') {
            const { GLTFLoader } = await import('three/addons/loaders/GLTFLoader.js');
            const splats = await import('three/addons/loaders/GLTFGaussianSplatLoaderExtension.js');
            const loader = new GLTFLoader().register((parser) => new splats.GLTFGaussianSplatLoaderExtension(parser));
            scene.add((await loader.loadAsync(url)).scene);
        } else {
            const { GaussianSplatPLYLoader } = await import('three/addons/loaders/GaussianSplatPLYLoader.js');
            const { SPZLoader } = await import('three/addons/loaders/SPZLoader.js');
            const loader = kind === 'spz' ? new SPZLoader() : new GaussianSplatPLYLoader();
            scene.add(new GaussianSplat(await loader.loadAsync(url)));
        }
        const camera = place(three, view);
        await renderer.setAnimationLoop(() => renderer.render(scene, camera));
    },

    async spark(url, kind, view, options) {
        const three = await import('three');
        const { SparkRenderer, SplatMesh } = await import('@sparkjsdev/spark');
        const renderer = new three.WebGLRenderer({ canvas: canvas(), antialias: false });
        renderer.setSize(SIZE, SIZE);
        const scene = new three.Scene();
        scene.background = new three.Color(0);
        scene.add(new SparkRenderer({ renderer, ...options }));
        const mesh = new SplatMesh({ url });
        await mesh.initialized;
        scene.add(mesh);
        const camera = place(three, view);
        renderer.setAnimationLoop(() => renderer.render(scene, camera));
    },

    async mkkellogg(url, kind, view) {
        const three = await import('three');
        const { Viewer, SceneRevealMode } = await import('@mkkellogg/gaussian-splats-3d');
        const renderer = new three.WebGLRenderer({ canvas: canvas(), antialias: false });
        renderer.setSize(SIZE, SIZE);
        renderer.setClearColor(0, 1);
        const camera = place(three, view);
        const viewer = new Viewer({
            selfDrivenMode: false, renderer, camera, useBuiltInControls: false, sharedMemoryForWorkers: false,
            sceneRevealMode: SceneRevealMode.Instant, sphericalHarmonicsDegree: 2,
        });
        await viewer.addSplatScene(url, { showLoadingUI: false });
        renderer.setAnimationLoop(() => {
            viewer.update();
            viewer.render();
        });
    },

    /** The engine of SuperSplat. */
    async playcanvas(url, kind, { eye, target, up, fov }) {
        const pc = await import('playcanvas');
        const graphicsDeviceOptions = { antialias: false, deviceTypes: ['webgl2'] };
        const app = new pc.Application(canvas(), { graphicsDeviceOptions });
        app.setCanvasResolution(pc.RESOLUTION_FIXED, SIZE, SIZE);
        app.start();
        const file = { url, filename: url.split('/').pop() };
        const asset = new pc.Asset('splats', kind === 'glb' ? 'container' : 'gsplat', file);
        app.assets.add(asset);
        await new Promise((done, fail) => {
            asset.once('load', done);
            asset.once('error', (text) => fail(new Error(text)));
            app.assets.load(asset);
        });
        let entity = new pc.Entity('splats');
        if (kind === 'glb') entity = asset.resource.instantiateRenderEntity();
        else entity.addComponent('gsplat', { asset });
        app.root.addChild(entity);
        const far = distance({ eye, target });
        const camera = new pc.Entity('camera');
        camera.addComponent('camera', { clearColor: new pc.Color(0, 0, 0), fov, nearClip: far / 10, farClip: far * 10 });
        app.root.addChild(camera);
        camera.setPosition(...eye);
        camera.lookAt(new pc.Vec3(...target), new pc.Vec3(...up));
    },

    /** It turns a file's y and z to the other side, and its own y is up: so its root is turned. */
    async supersplat(url, kind, { eye, target, fov }) {
        const pc = await import('playcanvas');
        const { createViewer } = await import('@playcanvas/supersplat-viewer/viewer');
        const { defaultSettings } = await import('@playcanvas/supersplat-viewer/settings');
        const turned = ([x, y, z]) => [x, z, -y];
        const settings = defaultSettings();
        settings.background.color = [0, 0, 0];
        settings.cameras = [{ initial: { position: turned(eye), target: turned(target), fov } }];
        const style = { rel: 'stylesheet', href: '/m/@playcanvas/supersplat-viewer/dist/viewer.css' };
        document.head.append(Object.assign(document.createElement('link'), style));
        const container = document.createElement('div');
        container.style = `width: ${SIZE}px; height: ${SIZE}px; position: relative`;
        document.body.append(container);
        const switches = { renderer: 'webgl', ui: false, noanim: true };
        const viewer = await createViewer({ container, settings, contentUrl: url, ...switches });
        const [back, tipped] = [[0, 0, 180], [-90, 0, 0]].map((angles) => new pc.Quat().setFromEulerAngles(...angles));
        viewer.app.root.setLocalRotation(tipped.mul(back));
        if (!viewer.state.loaded) await new Promise((done) => viewer.events.once('loaded:changed', done));
    },

    async babylon(url, kind, { eye, target, up, fov }) {
        for (const name of ['babylonjs/babylon.js', 'babylonjs-loaders/babylonjs.loaders.min.js']) {
            await new Promise((done, fail) => {
                const attributes = { src: `/m/${name}`, onload: done, onerror: fail };
                document.head.append(Object.assign(document.createElement('script'), attributes));
            });
        }
        const { Engine, Scene, Color4, Vector3, TargetCamera, AppendSceneAsync } = globalThis.BABYLON;
        const engine = new Engine(canvas(), false);
        const scene = new Scene(engine);
        scene.clearColor = new Color4(0, 0, 0, 1);
        // Its world is left-handed: it turns y of splats round, x of glTF.
        const side = kind === 'glb' ? [-1, 1, 1] : [1, -1, 1];
        const turned = (v) => new Vector3(...v.map((value, k) => value * side[k]));
        const camera = new TargetCamera('camera', turned(eye), scene);
        camera.upVector = turned(up);
        camera.setTarget(turned(target));
        camera.fov = fov * Math.PI / 180;
        const far = distance({ eye, target });
        [camera.minZ, camera.maxZ] = [far / 10, far * 10];
        // Without these it would load what it needs for .spz and .sog from unpkg.com.
        const splat = { spzLibraryUrl: undefined, fflate: await import('fflate') };
        await AppendSceneAsync(url, scene, { pluginOptions: { splat } });
        scene.activeCamera = camera;
        engine.runRenderLoop(() => scene.render());
    },
};

// Pictures stay in the canvas until they are taken. A frame begins when the one before it is finished, which a software
// driver needs.
const getContext = HTMLCanvasElement.prototype.getContext;
const contexts = new Set();
HTMLCanvasElement.prototype.getContext = function (kind, options) {
    const webgl = /^webgl/.test(kind);
    const context = getContext.call(this, kind, webgl ? { ...options, preserveDrawingBuffer: true } : options);
    if (webgl && context) contexts.add(context);
    return context;
};
let frames = 0;
window.requestAnimationFrame = (draw) => setTimeout(() => {
    draw(performance.now());
    for (const gl of contexts) gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
    ++frames;
}, 50);
window.cancelAnimationFrame = clearTimeout;

/** Opens a file in a viewer. */
window.show = ({ viewer, url, kind, camera, options }) => VIEWERS[viewer](url, kind, camera, options ?? {});

/** The picture, as the page shows it: on black. */
window.taken = async () => {
    for (const until = frames + 3; frames < until;) await new Promise((done) => setTimeout(done, 50));
    const flat = Object.assign(document.createElement('canvas'), { width: SIZE, height: SIZE });
    const context = flat.getContext('2d');
    context.fillRect(0, 0, SIZE, SIZE);
    context.drawImage(document.querySelector('canvas'), 0, 0);
    return flat.toDataURL();
};
