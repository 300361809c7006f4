// The same ten seconds everywhere: a turn about the body's axis in three looks, and a report of how fast it
// was.
import type { Look, TransferFunction } from '../types.ts';
import type { App } from './app.ts';
import { fitted, from, turned } from './camera.ts';

/** ms of the turn. */
const WHOLE = 10_000;
/** Longest that a finished picture is waited for, ms. */
const PATIENCE = 60_000;

/** What the page knows of its own start. */
export interface Start {
    /** Bytes of the page. */
    bytes: number;
    /** ms from the start of the page to the first picture. */
    firstPicture: number;
}

const faint = (tf: TransferFunction): TransferFunction => ({
    ...tf,
    opacities: tf.opacities.map(([v, opacity]) => [v, opacity * 0.05]),
});
const lit = (tf: TransferFunction, shade: boolean): TransferFunction => ({
    ...tf,
    material: { ...tf.material, shade, occlusion: 0 },
});
/** The looks, each for a third of the turn. */
const LOOKS: [string, (tf: TransferFunction) => TransferFunction][] = [
    ['lit', (tf) => lit(tf, true)],
    ['unlit', (tf) => lit(tf, false)],
    ['translucent', (tf) => lit(faint(tf), true)],
];

/** The times below which so many of them lie. */
export function quantiles(times: number[]): { frames: number; p50: number; p95: number; max: number } {
    const sorted = [...times].sort((a, b) => a - b);
    const at = (share: number) =>
        round(sorted[Math.min(Math.floor(share * sorted.length), sorted.length - 1)] ?? 0);
    return { frames: times.length, p50: at(0.5), p95: at(0.95), max: at(1) };
}

const round = (ms: number): number => Math.round(ms * 10) / 10;

/** Measures; says how far it is, 0 to 1. A signal ends it. */
export async function measure(
    app: App,
    start: Start,
    said: (share: number) => void,
    signal: AbortSignal,
): Promise<object> {
    const { display, look, camera, atlas } = app;
    const first = from(fitted(camera, app.corners, app.aspect), 'anterior');
    const { onframe } = display;
    try {
        const looks = [];
        for (const [i, [name, change]] of LOOKS.entries()) {
            show(app, { ...look, function: change(app.scene.function), clip: [], objects: plain(app) });
            looks.push({ look: name, ...(await turn(app, first, i, said, signal)) });
        }
        show(app, { ...look, function: lit(app.scene.function, true), clip: [], objects: plain(app) });
        const finished = await rest(app, signal);
        const { device } = display.stats;
        const { width, height } = display.canvas;
        return {
            report: 'vgs page 1',
            program: app.scene.program,
            browser: navigator.userAgent,
            device,
            cores: navigator.hardwareConcurrency,
            pixels: [width, height],
            density: devicePixelRatio,
            splats: atlas.splats,
            voxels: atlas.size.reduce((a, b) => a * b),
            texels: atlas.dims,
            objects: app.scene.objects.length,
            pageBytes: start.bytes,
            firstPictureMs: round(start.firstPicture),
            decodeMs: Object.fromEntries(
                Object.entries(atlas.times).map(([stage, ms]) => [stage, round(ms)]),
            ),
            looks,
            finishedMs: round(finished),
        };
    } finally {
        display.onframe = onframe;
        show(app, look);
        app.setCamera(camera);
    }
}

/** Shows a look that nobody has chosen, and that is nothing to be undone. */
function show(app: App, look: Look): void {
    app.look = look;
    app.changed('look');
}

/** All objects through the function of all. */
const plain = (app: App) =>
    new Map(
        app.scene.objects.map((object) => [
            object.number,
            { visible: true, tint: null, opacity: 1, function: null },
        ]),
    );

/**
 * A third of the turn: times between frames of the screen, times of drawing, and the levels that held them.
 */
async function turn(
    app: App,
    first: typeof app.camera,
    part: number,
    said: (share: number) => void,
    signal: AbortSignal,
): Promise<object> {
    const length = WHOLE / LOOKS.length;
    const [screen, drawn]: number[][] = [[], []];
    const levels: Record<string, number> = {};
    app.display.onframe = () => {
        const { frames, level } = app.display.stats;
        drawn.push(frames[frames.length - 1]);
        levels[level] = (levels[level] ?? 0) + 1;
    };
    const begin = await frame();
    for (let before = begin, now = begin; now - begin < length; before = now) {
        const share = (part + (now - begin) / length) / LOOKS.length;
        app.setCamera(turned(first, 2 * Math.PI * share, 0));
        said(share);
        now = await frame();
        screen.push(now - before);
        if (signal.aborted) throw Error('Stopped.');
        if (document.hidden) throw Error('The page was hidden, and nothing is drawn then. Measure again.');
    }
    return { screenMs: quantiles(screen), drawMs: quantiles(drawn), levels };
}

const frame = (): Promise<number> =>
    new Promise((done) => requestAnimationFrame(() => done(performance.now())));

/** ms from the last change to the finished picture. */
async function rest(app: App, signal: AbortSignal): Promise<number> {
    const { display } = app;
    const { onprogress } = display;
    const begin = performance.now();
    try {
        await new Promise<void>((done) => {
            const over = setTimeout(done, PATIENCE);
            const end = () => {
                clearTimeout(over);
                done();
            };
            signal.addEventListener('abort', end);
            display.onprogress = (share) => {
                onprogress?.(share);
                if (share >= 1) end();
            };
            app.changed('look');
        });
    } finally {
        display.onprogress = onprogress;
    }
    return performance.now() - begin;
}
