// The page: reads what the file carries, decodes it in a worker, and shows it.
import workerText from 'worker-text';
import { offerHeadset } from './headset/headset.ts';
import { offerInterface, sceneFromOutside } from './interface.ts';
import { Display } from './render/display.ts';
import { DAMAGED, sceneIn, type Data } from './scene.ts';
import type { Atlas, FromWorker, ToWorker } from './types.ts';
import { follow, restore, UNREADABLE } from './ui/address.ts';
import { App } from './ui/app.ts';
import { byId } from './ui/elements.ts';
import type { Start } from './ui/measure.ts';
import { navigation } from './ui/navigation.ts';
import { fail, mend, note, progress } from './ui/notices.ts';
import { overlay } from './ui/overlay.ts';
import { panels } from './ui/panels.ts';

const BROWSERS = 'Open this page in a current Chrome, Edge, Firefox or Safari.';
/** ms after which a context that was lost is not waited for any more. */
const GONE = 5000;

/** What the browser lacks, in words; null: nothing. */
function missing(): string | null {
    const gl = document.createElement('canvas').getContext('webgl2');
    gl?.getExtension('WEBGL_lose_context')?.loseContext();
    if (!gl) return 'This browser has no WebGL2, or its graphics driver is switched off.';
    if (typeof Worker === 'undefined' || typeof DecompressionStream === 'undefined')
        return 'This browser is too old for this page.';
    return null;
}

/** Decodes what the file carries. */
function decoded(parts: Data[]): Promise<Atlas> {
    return new Promise((done, failed) => {
        const url = URL.createObjectURL(new Blob([workerText], { type: 'text/javascript' }));
        const worker = new Worker(url);
        worker.onmessage = ({ data }: MessageEvent<FromWorker>) => {
            if ('progress' in data) {
                progress(Math.min(data.progress, 0.99), data.stage);
                return;
            }
            worker.terminate();
            URL.revokeObjectURL(url);
            if ('atlas' in data) done(data.atlas);
            else failed(Error(data.error));
        };
        worker.onerror = (event) => {
            event.preventDefault();
            failed(Error(DAMAGED));
        };
        const message: ToWorker = { parts };
        worker.postMessage(
            message,
            parts.map(({ data }) => data.buffer),
        );
    });
}

/** Says what happens to the graphics device, and takes the picture up again when it is back. */
function watch(display: Display): void {
    let waiting: ReturnType<typeof setTimeout>;
    display.onlost = (lost) => {
        clearTimeout(waiting);
        mend();
        if (!lost) return;
        fail('The graphics device was taken away', 'The picture comes back with it. Nothing has to be done.');
        waiting = setTimeout(
            () =>
                fail(
                    'The graphics device is gone',
                    'Close other 3D pages and load this one again. Its address keeps the view.',
                    true,
                ),
            GONE,
        );
    };
}

// The loader has put it there; the page is measured, and kept, without it.
document.currentScript?.remove();

/** Ends when the first picture is there. */
const started = new AbortController();

/** Says what went wrong; only errors of the page's own are sentences. */
function failed(error: unknown): void {
    const sentence =
        error instanceof Error && error.constructor === Error
            ? error.message
            : `Something went wrong that should not (${error}). Load the page again, or get the file again.`;
    fail('This page cannot show its scene', sentence);
}

for (const type of ['error', 'unhandledrejection'] as const)
    addEventListener(
        type,
        (event) => {
            const error: unknown = event instanceof ErrorEvent ? event.error : event.reason;
            // Notices of the browser are events of this kind, too, without an error.
            if (!error) return;
            event.preventDefault();
            failed(error);
        },
        { signal: started.signal },
    );

async function start(): Promise<void> {
    const bytes = new Blob([document.documentElement.outerHTML]).size;
    const lack = missing();
    if (lack) {
        fail(lack, BROWSERS);
        return;
    }
    const carried = sceneIn(document) ?? (await sceneFromOutside());
    if (!carried) throw Error(DAMAGED);
    const { scene, data } = carried;
    document.title = scene.title;
    byId('title').textContent = byId('title').title = scene.title;
    const atlas = await decoded(data);
    progress(0.99, 'Preparing the picture');
    const display = new Display(byId<HTMLCanvasElement>('picture'), atlas);
    const app = new App(scene, atlas, display);
    const began: Start = { bytes, firstPicture: 0 };
    watch(display);
    const fits = () => {
        const { clientWidth, clientHeight } = display.canvas;
        app.aspect = clientWidth / Math.max(clientHeight, 1);
        display.resize();
    };
    navigation(app, panels(app, began));
    overlay(app);
    new ResizeObserver(fits).observe(display.canvas);
    fits();
    display.onprogress = (share) => {
        if (!began.firstPicture) {
            started.abort();
            began.firstPicture = performance.now();
            progress(1, '');
        }
        byId('refined').style.width = share < 1 ? `${100 * share}%` : '0';
    };
    // Before there is a look and a view, nothing is drawn.
    const restored = await restore(app);
    app.changed('look');
    app.changed('camera');
    if (!restored) note(UNREADABLE);
    follow(app);
    offerInterface(app);
    await offerHeadset(app, byId('headset'));
}

start().catch(failed);
