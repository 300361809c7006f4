// The state of the page as a part of its address: #s=1… The number is the version; what follows is JSON of
// what differs from the file, deflated, in the letters of base64url.
import type { Appearance, TransferFunction, Vec3 } from '../types.ts';
import type { App } from './app.ts';
import * as checks from './checks.ts';
import { note } from './notices.ts';
import { clamp } from './vectors.ts';

export const UNREADABLE = 'What the address says of the view cannot be read: it is shown as in the file.';
const VERSION = '1';
/** ms without a change after which the address follows. */
const PAUSE = 500;
/** Longest state that is read, characters. */
const LONGEST = 1e5;

/** A function: its index among the presets and its material, or all of it. */
type Written = [number, TransferFunction['material']] | TransferFunction;

const same = (a: unknown, b: unknown): boolean => JSON.stringify(a) === JSON.stringify(b);

/** Numbers to six digits, which is far below what a screen shows. */
const short = (_: string, value: unknown): unknown =>
    typeof value === 'number' ? Number(value.toPrecision(6)) : value;

function written(app: App, tf: TransferFunction): Written {
    const plain = ({ material: _, ...rest }: TransferFunction) => rest;
    const index = app.scene.presets.findIndex((preset) => same(plain(preset), plain(tf)));
    return index < 0 ? tf : [index, tf.material];
}

function read(app: App, raw: unknown): TransferFunction | null {
    if (Array.isArray(raw)) {
        const [index, material] = raw as unknown[];
        const preset = Number.isSafeInteger(index) ? app.scene.presets[index as number] : undefined;
        return preset && checks.isMaterial(material) ? { ...preset, material } : null;
    }
    return checks.isFunction(raw) ? raw : null;
}

/** What differs from the file; null: nothing. */
export function stateOf(app: App): object | null {
    const { look, camera, scene } = app;
    const objects = scene.objects.flatMap((object) => {
        const now = app.appearance(object.number);
        const change: Record<string, unknown> = {};
        for (const key of ['visible', 'tint', 'opacity'] as const)
            if (!same(now[key], object[key])) change[key] = now[key];
        if (!same(now.function, object.function))
            change.function = now.function && written(app, now.function);
        return Object.keys(change).length ? [[object.number, change]] : [];
    });
    const state = {
        ...(same(camera, scene.camera) ? {} : { camera }),
        ...(same(look.function, scene.function) ? {} : { function: written(app, look.function) }),
        ...(objects.length ? { objects } : {}),
        ...(same(look.clip, app.firstClip) ? {} : { clip: look.clip }),
        ...(same(look.light, scene.light) ? {} : { light: look.light }),
        ...(app.slices ? { place: app.place } : {}),
    };
    return Object.keys(state).length ? state : null;
}

/** Takes over a state; false: it is none, and nothing has changed. */
export function takeState(app: App, raw: unknown): boolean {
    if (!checks.isRecord(raw)) return false;
    const { camera, clip, light, place } = raw;
    const tf = raw.function === undefined ? undefined : read(app, raw.function);
    const sound =
        (camera === undefined || checks.isCamera(camera)) &&
        tf !== null &&
        (clip === undefined || checks.isClip(clip)) &&
        (light === undefined || checks.isLight(light)) &&
        (place === undefined || checks.isVector(place));
    const objects = objectsOf(app, raw.objects ?? []);
    if (!sound || !objects) return false;
    if (objects.size || tf)
        app.setLook({
            objects: new Map([...app.look.objects, ...objects]),
            function: tf ?? app.look.function,
        });
    if (clip) app.setClip(clip);
    if (light) app.setLight(light);
    if (camera) app.setCamera(camera);
    if (place) {
        const [low, high] = app.extent;
        app.setPlace(place.map((mm, k) => clamp(mm, low[k], high[k])) as Vec3);
        app.setSlices(true);
    }
    return true;
}

function objectsOf(app: App, raw: unknown): Map<number, Appearance> | null {
    const objects = new Map<number, Appearance>();
    if (!Array.isArray(raw)) return null;
    for (const row of raw) {
        const [number, change] = Array.isArray(row) ? row : [];
        if (!checks.isRecord(change) || !app.scene.objects.some((o) => o.number === number)) return null;
        if (change.function) change.function = read(app, change.function) ?? 'unreadable';
        if (!checks.isAppearance(change)) return null;
        objects.set(number, { ...app.appearance(number), ...change });
    }
    return objects;
}

async function through(
    bytes: Blob,
    stream: CompressionStream | DecompressionStream,
): Promise<Uint8Array<ArrayBuffer>> {
    return new Uint8Array(await new Response(bytes.stream().pipeThrough(stream)).arrayBuffer());
}

export async function packed(state: object): Promise<string> {
    const bytes = await through(
        new Blob([JSON.stringify(state, short)]),
        new CompressionStream('deflate-raw'),
    );
    const text = btoa(String.fromCharCode(...bytes));
    return VERSION + text.replaceAll('+', '-').replaceAll('/', '_').replaceAll('=', '');
}

export async function unpacked(text: string): Promise<unknown> {
    if (text[0] !== VERSION || text.length > LONGEST) throw Error('another version');
    const bytes = atob(text.slice(1).replaceAll('-', '+').replaceAll('_', '/'));
    const stream = new DecompressionStream('deflate-raw');
    const json = await through(new Blob([Uint8Array.from(bytes, (c) => c.charCodeAt(0))]), stream);
    return JSON.parse(new TextDecoder().decode(json));
}

/** The address of the page with its state. */
export async function address(app: App): Promise<string> {
    const state = stateOf(app);
    return location.href.split('#')[0] + (state ? `#s=${await packed(state)}` : '');
}

/** Takes the state of the address over; false: the address has one that cannot be read. */
export async function restore(app: App): Promise<boolean> {
    const found = /^#s=(.*)$/.exec(location.hash);
    if (!found) return true;
    try {
        return takeState(app, await unpacked(found[1]));
    } catch {
        return false;
    }
}

/** Lets the address follow the state, and the state an address that somebody types. */
export function follow(app: App): void {
    let waiting: ReturnType<typeof setTimeout>;
    const write = async () => {
        try {
            history.replaceState(null, '', await address(app));
        } catch {
            // Where a page has no address of its own, as within another one, the state is not kept.
        }
    };
    addEventListener('hashchange', async () => {
        app.reset();
        if (!(await restore(app))) note(UNREADABLE);
    });
    for (const change of ['look', 'camera', 'place', 'panels'] as const)
        app.on(change, () => {
            clearTimeout(waiting);
            waiting = setTimeout(() => void write(), PAUSE);
        });
}
