// The one place through which a page around this one talks to it, as a notebook does: data in, messages out.
// Messages are objects with `vgs: 1` and a `type`, by postMessage. Only the page around this one is listened
// to, and only it is told.
//
// In:   scene    { scene, data }  what to show, where the file carries nothing: types.ts, and a Uint8Array
//                for each part
//       look     { function?, objects?, clip?, light? }  objects: [[number, a part of an Appearance], …]
//       camera   { camera }
//       reset
//       get      { id }  answered by `state`, with the same id
//       picture  { id }  answered by `picture`, with the same id and a PNG
// Out:  waiting  where the file carries nothing
//       ready    { scene }  without its title
//       state    { id, camera, look }
//       changed  { camera }, { look } or { reading }, at most one of each kind a frame
//       picture  { id, blob }
//       error    { message }
import type { Data } from './scene.ts';
import type { Scene } from './types.ts';
import type { App } from './ui/app.ts';
import { takeState } from './ui/address.ts';
import { isRecord } from './ui/checks.ts';

const isEmbedded = (): boolean => window.parent !== window;

/** Says something to the page around this one. */
function tell(type: string, content: object = {}): void {
    if (isEmbedded()) window.parent.postMessage({ vgs: 1, type, ...content }, '*');
}

function listen(heard: (message: Record<string, unknown>) => void): void {
    addEventListener('message', ({ source, data }) => {
        if (source === window.parent && isRecord(data) && data.vgs === 1) heard(data);
    });
}

/** Waits for what the page around this one has to show; null: there is none. */
export function sceneFromOutside(): Promise<{ scene: Scene; data: Data[] }> | null {
    if (!isEmbedded()) return null;
    return new Promise((done) => {
        listen(({ type, scene, data }) => {
            if (type !== 'scene') return;
            const parts =
                isRecord(scene) && Array.isArray(scene.parts) ? (scene as unknown as Scene).parts : [];
            const bytes = Array.isArray(data) && data.every((part) => part instanceof Uint8Array) ? data : [];
            if (parts.length === 0 || parts.length !== bytes.length) {
                tell('error', { message: 'A scene needs a Uint8Array for each of its parts.' });
                return;
            }
            done({
                scene: scene as unknown as Scene,
                data: parts.map((part, i) => ({ ...part, data: bytes[i] })),
            });
        });
        tell('waiting');
    });
}

/** Opens the page to the one around it. */
export function offerInterface(app: App): void {
    if (!isEmbedded()) return;
    listen(
        (message) =>
            void answer(app, message).catch((error: Error) => tell('error', { message: error.message })),
    );
    const { title: _, ...scene } = app.scene;
    const waiting = new Set<'camera' | 'look' | 'reading'>();
    for (const change of ['camera', 'look', 'reading'] as const)
        app.on(change, () => {
            if (waiting.size === 0)
                requestAnimationFrame(() => {
                    tell('changed', Object.fromEntries([...waiting].map((kind) => [kind, app[kind]])));
                    waiting.clear();
                });
            waiting.add(change);
        });
    tell('ready', { scene });
}

async function answer(app: App, { type, id, ...content }: Record<string, unknown>): Promise<void> {
    if (type === 'look' || type === 'camera') {
        const { camera, function: tf, objects, clip, light } = content;
        const state = Object.entries({ camera, function: tf, objects, clip, light }).filter(
            ([, value]) => value !== undefined,
        );
        if (!takeState(app, Object.fromEntries(state)))
            throw Error(`The message '${type}' is not as interface.ts has it.`);
    } else if (type === 'reset') {
        app.reset();
    } else if (type === 'get') {
        tell('state', { id, camera: app.camera, look: app.look });
    } else if (type === 'picture') {
        tell('picture', { id, blob: await app.display.snapshot() });
    }
}
