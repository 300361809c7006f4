// What tests of the headset call in the browser: a ball of two objects, and an emulated headset (iwer) that
// shows it.
import { metaQuest3, XRDevice } from 'iwer';
import { onPlane } from '../headset/sheets.ts';
import { patientOf, roomOf, viewOf } from '../headset/placement.ts';
import { offerHeadset } from '../headset/headset.ts';
import { arc, direction, turned } from '../headset/pose.ts';
import { Visit } from '../headset/visit.ts';
import { add, cross, scaled, sub } from '../render/vectors.ts';
import { Display } from '../render/display.ts';
import { half } from '../half.ts';
import type { Atlas, Port, Scene, TransferFunction, Vec3 } from '../types.ts';
import { App } from '../ui/app.ts';

/** Voxels of 2 mm along each edge of the box, and the radius of the ball in it, voxels. */
const SIZE = 46, RADIUS = 20;
const MIDDLE = (SIZE - 1) / 2;

/** A ball of 1000 HU, whose lower half is object 1 and whose upper half object 2. */
function ball(): Atlas {
    const bricks = (SIZE + 8) >> 3;
    const dims: Vec3 = [9 * (bricks + 1), 9 * bricks, 9 * bricks];
    const texels = new Uint16Array(2 * dims[0] * dims[1] * dims[2]);
    const labels = new Uint8Array(texels.length);
    const places = new Uint32Array(bricks ** 3);
    const brickAt = new Uint32Array((bricks + 1) * bricks * bricks).fill(0xffffffff);
    for (let b = 0; b < places.length; b++) {
        const at = [b % bricks, Math.floor(b / bricks) % bricks, Math.floor(b / bricks ** 2)];
        // The first place is the empty one.
        places[b] = (at[0] + 1) | (at[1] << 10) | (at[2] << 20);
        brickAt[(at[2] * bricks + at[1]) * (bricks + 1) + at[0] + 1] = at[0] | (at[1] << 10) | (at[2] << 20);
        for (let i = 0; i < 729; i++) {
            const texel = [i % 9, Math.floor(i / 9) % 9, Math.floor(i / 81)];
            const voxel = texel.map((t, k) => 8 * at[k] - 1 + t);
            const distance = Math.hypot(...voxel.map((v) => v - MIDDLE));
            const [x, y, z] = texel.map((t, k) => 9 * (k ? at[k] : at[0] + 1) + t);
            const index = (z * dims[1] + y) * dims[0] + x;
            texels[2 * index] = half(500);
            texels[2 * index + 1] = half(Math.min(Math.max(RADIUS + 0.5 - distance, 0), 1));
            labels[2 * index] = voxel[2] < MIDDLE ? 1 : 2;
        }
    }
    const leaps = Math.ceil((SIZE + 1) / 4);
    const intervals = new Float32Array(2 * leaps ** 3).map((_, i) => (i % 2 ? 1000 : 0));
    return {
        size: [SIZE, SIZE, SIZE], worldFromVoxel: [2, 0, 0, -45, 0, 2, 0, 20, 0, 0, 2, 100], edge: 2,
        range: [0, 1000], middle: 500, scale: 1, bricks: [bricks, bricks, bricks], places, brickAt, dims,
        texels, labels, label: 1, leaps: { shift: [2, 2, 2], bricks: [leaps, leaps, leaps], intervals },
        histograms: new Map(), splats: 0, times: {},
    };
}

const material = { shade: false, ambient: 1, diffuse: 0, specular: 0, power: 1, occlusion: 0 };
const named = (name: string, colour: Vec3): TransferFunction => ({
    name, colours: [[200, ...colour], [1200, ...colour]], opacities: [[200, 0], [800, 0.6], [1200, 0.6]],
    gradientOpacities: [], material,
});
const presets = [named('White', [1, 1, 1]), named('Red', [1, 0, 0]), named('Blue', [0, 0, 1])];
const plain = { visible: true, tint: null, opacity: 1, function: null };
const scene: Scene = {
    program: 'vgs', title: 'Ball', unit: 'hu', parts: [], presets, function: presets[0],
    objects: [{ number: 1, name: 'Lower', ...plain }, { number: 2, name: 'Upper', ...plain }],
    light: { direction: [0, 0, 1], fixedTo: 'camera', fill: 0 }, clip: [], background: [0, 0, 0],
    camera: { eye: [0, 500, 145], target: [0, 65, 145], up: [0, 0, 1], fieldOfView: 30 },
};

document.body.innerHTML = '<div id="note" hidden></div><button id="headset">Headset</button>'
    + '<canvas style="display:block;width:320px;height:240px"></canvas>';
const button = document.getElementById('headset') as HTMLButtonElement;
const device = new XRDevice(metaQuest3, { stereoEnabled: true });
const display = new Display(document.querySelector('canvas')!, ball());
const app = new App(scene, display.atlas, display);
const { gl, renderer } = display;
/** The image of an eye where there are layers. */
const LAYER: Port = { x: 0, y: 0, width: 320, height: 320 };

/** The time that the headset tells, ms; null: that of the clock. */
let clock: number | null = null;
const now = performance.now.bind(performance);
performance.now = () => clock ?? now();

const bytesOf = (port: Port): Uint8Array => {
    const bytes = new Uint8Array(4 * port.width * port.height);
    gl.readPixels(port.x, port.y, port.width, port.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    return bytes;
};

const api = {
    app, device, button, renderer, gl, scene, patientOf, roomOf, viewOf, onPlane,
    visit: null as Visit | null,

    install(): void {
        device.installRuntime({ forceInstall: true });
    },
    start(): void {
        app.changed('look');
        app.changed('camera');
    },
    offer: (to = button): Promise<void> => offerHeadset(app, to),

    /** Begins a session without the button, at a level of quality that it keeps, or at the last where there are fewer. */
    async begin(
        level: number, mode: XRSessionMode = 'immersive-vr', optionalFeatures = ['hand-tracking'],
    ): Promise<void> {
        const session = await navigator.xr!.requestSession(mode, { optionalFeatures });
        api.visit = await Visit.begin(app, session, mode);
        api.hold(level);
        await api.frames(2);
    },
    async end(): Promise<void> {
        await api.visit?.session.end();
        api.visit = null;
        device.controllers.left!.connected = device.controllers.right!.connected = true;
        device.primaryInputMode = 'controller';
        app.reset();
        app.setPlane(null);
    },
    hold(level: number): void {
        const { budget, report } = api.visit!;
        budget.level = Math.min(level, report.levels.length - 1);
        budget.frame = () => {};
    },
    /** Waits for frames of the session, or for those of the page. */
    async frames(count: number): Promise<void> {
        for (let i = 0; i < count; i++) {
            const session = device.activeSession;
            await new Promise((done) => {
                (session ?? window).requestAnimationFrame(done);
                session?.addEventListener('end', done);
            });
        }
    },
    /** Hides all that is drawn over the picture. */
    bare(): void {
        device.controllers.left!.connected = device.controllers.right!.connected = false;
        api.visit!.pointing.place = null;
    },
    tick(ms: number): void {
        clock = (clock ?? now()) + ms;
    },
    real(): void {
        clock = null;
    },

    hand(side: 'left' | 'right', at: Vec3, towards?: Vec3): void {
        const hand = (device.primaryInputMode === 'hand' ? device.hands : device.controllers)[side]!;
        hand.position.set(...at);
        if (!towards) return;
        const back = direction(sub(at, towards), [0, 0, 1]);
        const right = direction(cross([0, 1, 0], back), [1, 0, 0]), up = cross(back, right);
        const w = Math.sqrt(Math.max(1 + right[0] + up[1] + back[2], 1e-9)) / 2;
        hand.quaternion.set(
            (up[2] - back[1]) / (4 * w), (back[0] - right[2]) / (4 * w), (right[1] - up[0]) / (4 * w), w);
    },
    press(side: 'left' | 'right', name: string, value: number): void {
        device.controllers[side]!.updateButtonValue(name, value);
    },
    /**
     * A point of the panel in the emulated room, in which the page's room begins where the head was, 1.6 m
     * up.
     */
    onPanel: (x: number, y: number): Vec3 => add(onPlane(api.visit!.pointing.place!, x, y), [0, 1.6, 0]),

    /** Clicks on a point of the panel with the right hand. */
    async click(x: number, y: number): Promise<void> {
        api.hand('right', [0.2, 1.3, -0.2], api.onPanel(x, y));
        await api.frames(2);
        api.press('right', 'trigger', 1);
        await api.frames(2);
        api.press('right', 'trigger', 0);
        await api.frames(2);
    },

    /** The next frame: its views, their ports, and what is in them. */
    shot(): Promise<{ view: XRView; port: Port; bytes: Uint8Array }[]> {
        const { session } = api.visit!;
        return new Promise((done) => session.requestAnimationFrame((_, frame) => {
            done(frame.getViewerPose(api.visit!.space)!.views.map((view) => {
                const found = session.renderState.baseLayer!.getViewport(view)!;
                const port = { x: found.x, y: found.y, width: found.width, height: found.height };
                return { view, port, bytes: bytesOf(port) };
            }));
        }));
    },

    /** The same view drawn alone. */
    alone(view: XRView, { width, height }: Port): Uint8Array {
        const target = gl.createFramebuffer(), texture = gl.createTexture();
        gl.bindTexture(gl.TEXTURE_2D, texture);
        gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA8, width, height);
        gl.bindFramebuffer(gl.FRAMEBUFFER, target);
        gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
        const port = { x: 0, y: 0, width, height };
        renderer.draw(
            [{ view: viewOf(api.visit!.controls.placement, view), port }], target,
            { step: 0.25, cell: null, occlusion: false });
        const bytes = bytesOf(port);
        gl.bindFramebuffer(gl.FRAMEBUFFER, null);
        gl.deleteFramebuffer(target);
        gl.deleteTexture(texture);
        return bytes;
    },

    /** How many pixels are lit, their middle (from the lower left corner), and the least opacity. */
    lit(bytes: Uint8Array, width: number): { count: number; x: number; y: number; alpha: number } {
        let count = 0, x = 0, y = 0, alpha = 255;
        for (let i = 0; i < bytes.length; i += 4) {
            alpha = Math.min(alpha, bytes[i + 3]);
            if (Math.max(bytes[i], bytes[i + 1], bytes[i + 2]) < 100) continue;
            count++;
            x += ((i / 4) % width) + 0.5;
            y += Math.floor(i / 4 / width) + 0.5;
        }
        return { count, x: x / count, y: y / count, alpha };
    },
    greatest: (a: Uint8Array, b: Uint8Array): number =>
        a.reduce((most, v, i) => Math.max(most, Math.abs(v - b[i])), 0),
    /** Where an eye should see the middle of the ball. */
    wanted: (view: XRView, port: Port): [number, number] =>
        api.projected(view, port, roomOf(api.visit!.controls.placement, api.middle())),

    /** What iwer has no word for: images with a layer for each eye. */
    offerLayers(): void {
        (device.supportedFeatures as string[]).push('layers');
        const binding = XRWebGLBinding.prototype, session = XRSession.prototype;
        const texture = gl.createTexture()!;
        gl.bindTexture(gl.TEXTURE_2D_ARRAY, texture);
        gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.RGBA8, LAYER.width, LAYER.height, 2);
        const { updateRenderState } = session;
        Object.assign(binding, {
            createProjectionLayer: (init: XRProjectionLayerInit) => {
                if (init.textureType !== 'texture-array') throw new Error('an array is asked for');
                return {};
            },
            getViewSubImage: (_: XRProjectionLayer, view: XRView) => ({
                colorTexture: texture, imageIndex: view.eye === 'left' ? 0 : 1, viewport: LAYER,
            }),
        });
        session.updateRenderState = async function () {
            // iwer runs its loop for a layer of the old kind.
            updateRenderState.call(this, { baseLayer: new XRWebGLLayer(this, gl) });
        };
        api.withdrawLayers = () => {
            device.supportedFeatures.pop();
            delete (binding as Partial<XRWebGLBinding>).createProjectionLayer;
            session.updateRenderState = updateRenderState;
        };
        api.layers = async () => (await api.shot()).map(({ view }, layer) => {
            const target = gl.createFramebuffer();
            gl.bindFramebuffer(gl.FRAMEBUFFER, target);
            gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, texture, 0, layer);
            const bytes = bytesOf(LAYER);
            gl.bindFramebuffer(gl.FRAMEBUFFER, null);
            gl.deleteFramebuffer(target);
            return { view, port: LAYER, bytes };
        });
    },
    withdrawLayers: (): void => {},
    layers: async (): Promise<{ view: XRView; port: Port; bytes: Uint8Array }[]> => [],

    /** Where a hand holds things, and how firmly, as the page sees it in the last frame. */
    grip: (side: number): Vec3 => api.visit!.hands[side].grip!.position,
    squeeze: (side: number): number => api.visit!.hands[side].squeeze,
    /** Holds the palm of the left hand, which was not turned before, towards the eyes. */
    showPalm(): void {
        const palm = turned(api.visit!.hands[0].grip!.orientation, [1, 0, 0]);
        const at: Vec3 = [0, 1.5, -0.4];
        api.hand('left', at);
        device.hands.left!.quaternion.set(...arc(palm, direction(sub([0, 1.6, 0], at), palm)));
    },

    /** True once the page shows its finished picture. */
    finished: (): boolean => api.progress >= 1,
    progress: 0,

    /** Where an eye sees a place of the room: pixels from the lower left corner of its port. */
    projected({ transform, projectionMatrix: p }: XRView, port: Port, [x, y, z]: Vec3): [number, number] {
        const m = transform.inverse.matrix;
        const of = (q: Float32Array, [a, b, c, d]: number[]) =>
            [0, 1, 2, 3].map((r) => q[r] * a + q[4 + r] * b + q[8 + r] * c + q[12 + r] * d);
        const [cx, cy, , cw] = of(p, of(m, [x, y, z, 1]));
        return [((cx / cw + 1) / 2) * port.width, ((cy / cw + 1) / 2) * port.height];
    },
    middle: (): Vec3 => scaled(add(...app.extent), 0.5),
};
export type Api = typeof api;
display.onprogress = (share) => (api.progress = share);
Object.assign(window, { api });
