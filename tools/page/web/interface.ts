// The one place through which a page around this one talks to it, as a notebook does: data in, messages out.
// Messages are objects with `vgs: 1` and a `type`, by postMessage. Only the page around this one is listened
// to, and only it is told: where the file carries a scene, only if that page is of the same origin, since any
// page may frame a served one; otherwise it is the one that gave the scene.
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
import { isRecord, isScene } from './ui/checks.ts';

/** Origin of the page that is listened to and told; null: there is none. */
let partner: string | null = null;

/** Opaque origins cannot be addressed. */
const isOpaque = (of: string): boolean => of === 'null' || of.startsWith('file:');

/** Origin of the page around this one, if it is that of this one. */
function ownOrigin(): string | null {
    try {
        const around = window.parent === window ? 'null' : window.parent.location.origin;
        return !isOpaque(around) && around === self.origin ? around : null;
    } catch {
        return null;
    }
}

/** Says something to the page around this one. */
function tell(type: string, content: object = {}, to = partner): void {
    if (to !== null) window.parent.postMessage({ vgs: 1, type, ...content }, isOpaque(to) ? '*' : to);
}

/** Listens to the page around this one; returns what ends it. */
function listen(heard: (message: Record<string, unknown>, from: string) => void): () => void {
    const take = ({ source, origin, data }: MessageEvent) => {
        if (source === window.parent && isRecord(data) && data.vgs === 1) heard(data, origin);
    };
    addEventListener('message', take);
    return () => removeEventListener('message', take);
}

/** Waits for what the page around this one has to show; null: there is none. */
export function sceneFromOutside(): Promise<{ scene: Scene; data: Data[] }> | null {
    if (window.parent === window) return null;
    return new Promise((done) => {
        const end = listen(({ type, scene, data }, from) => {
            if (type !== 'scene') return;
            const refuse = (message: string) => tell('error', { message }, from);
            if (!isScene(scene)) {
                refuse('The scene is not as types.ts has it.');
                return;
            }
            const bytes = Array.isArray(data) && data.every((part) => part instanceof Uint8Array) ? data : [];
            if (scene.parts.length !== bytes.length) {
                refuse('A scene needs a Uint8Array for each of its parts.');
                return;
            }
            end();
            partner = from;
            done({ scene, data: scene.parts.map((part, i) => ({ ...part, data: bytes[i] })) });
        });
        // Whoever it is: nothing is said but that the page is empty.
        tell('waiting', {}, 'null');
    });
}

/** Opens the page to the one around it. */
export function offerInterface(app: App): void {
    partner ??= ownOrigin();
    if (partner === null) return;
    listen((message, from) => {
        if (from !== partner) return;
        void answer(app, message).catch((error: Error) => tell('error', { message: error.message }));
    });
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
