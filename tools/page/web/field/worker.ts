// The worker's entry: from the parts of a scene to the atlas.
import type { Atlas, FromWorker, Part, ToWorker } from '../types.ts';
import { makeAtlas } from './atlas.ts';
import { decodeSplats } from './decode.ts';
import type { Field, Progress } from './field.ts';
import { GET_AGAIN, Refusal } from './refusal.ts';
import type { Numbered } from './sums.ts';
import { readVgs } from './vgs.ts';
import { readVoxels } from './voxels.ts';

type Data = Part & { data: Uint8Array };

/** Parts of the whole at which stages begin and end, and what a reader of the page is told of them. */
const STAGES = {
    reading: { from: 0, to: 0.25, text: 'Reading the splats' },
    decoding: { from: 0.25, to: 0.65, text: 'Decoding the field' },
    arranging: { from: 0.65, to: 1, text: 'Arranging the voxels' },
};

/**
 * Decodes the parts of a scene. `tell` is told again and again what is being done, and the part of all that
 * is done.
 */
export function decode(parts: Data[], tell: (stage: string, part: number) => void): Atlas {
    const times: Record<string, number> = {};
    const progress: Progress = (stage, part) => {
        const { from, to, text } = STAGES[stage];
        tell(text, from + part * (to - from));
    };
    const timed = <T>(name: string, work: () => T): T => {
        const begin = performance.now(), made = work();
        times[name] = performance.now() - begin;
        return made;
    };
    const [first] = parts;
    if (!first || (parts.length > 1 && parts.some(({ kind }) => kind !== 'vgs'))) {
        throw new Refusal(`The page holds no scene that it can show. ${GET_AGAIN}`);
    }
    const read = (part: Data, i: number): Numbered => {
        progress('reading', i / parts.length);
        return { set: readVgs(part.data), numbers: part.numbers };
    };
    let field: Field;
    if (first.kind === 'vgs') {
        const sets = timed('read', () => parts.map(read));
        field = timed('decode', () => decodeSplats(sets, progress));
    } else {
        field = timed('read', () => readVoxels(first.data, first.numbers, progress));
    }
    const atlas = timed('arrange', () => makeAtlas(field, progress));
    return { ...atlas, times };
}

/** What a reader of the page is told of an error. */
function told(error: unknown): string {
    if (error instanceof Refusal) return error.message;
    const what = error instanceof Error ? error.message : String(error);
    return `The scene could not be decoded here, probably for lack of memory (${what}). Close other pages, ` +
        'or open it in another browser.';
}

if (typeof importScripts === 'function') {
    const post = (message: FromWorker, transfer: Transferable[] = []): void =>
        self.postMessage(message, { transfer });
    self.onmessage = ({ data }: MessageEvent<ToWorker>): void => {
        try {
            const atlas = decode(data.parts, (stage, progress) => post({ progress, stage }));
            const arrays = [atlas.places, atlas.brickAt, atlas.texels, atlas.labels, atlas.leaps.intervals];
            post({ atlas }, arrays.flatMap((array) => (array ? [array.buffer as ArrayBuffer] : [])));
        } catch (error) {
            post({ error: told(error) });
        }
    };
}
