// Values beyond a region, continued from inside it (engine/volume/src/beyond.rs, which has the method).
import { Around, eachBrick } from './bricks.ts';
import { ROWS, SAMPLES } from './field.ts';
import type { Field } from './field.ts';

/** Voxels along each axis of a brick and those beside it. */
const WIDE = 10;
/** Where the 27 voxels around one are in a block, x fastest, and their weights. */
const STEPS = Array.from({ length: 27 }, (_, n) =>
    [n % 3 - 1, Math.floor(n / 3) % 3 - 1, Math.floor(n / 9) - 1]);
const AWAY = STEPS.map(([x, y, z]) => (z * WIDE + y) * WIDE + x);
const WEIGHTS = STEPS.map((step) => step.reduce((weight, d) => weight * (d === 0 ? 0.5 : 0.25), 1));

/**
 * Gives the voxels up to `layers` voxels from those that have a kind the kind of the nearest, by weight, and
 * a value: of the one continued from it and of their own the lower one if what has this kind is brighter
 * than what is around it, and the higher one if it is darker. Values that are not known are NaN.
 */
export function extend(
    of: Pick<Field, 'bricks' | 'slots' | 'values'>, kinds: Uint8Array, layers: number,
): void {
    const { bricks, slots, values } = of, around = new Around(of);
    const set = new Uint8Array(kinds.length / 8);
    // Of the voxels that are found: where they are, their kinds, what is continued to them, their own values.
    const places: number[] = [], found: number[] = [], continued: number[] = [], own: number[] = [];
    const sums = new Float32Array(256), weights = new Float32Array(256), near = new Uint8Array(ROWS);
    for (let i = 0; i < kinds.length; i++) if (kinds[i]) set[i >> 3] |= 1 << (i & 7);
    const blockKinds = new Uint8Array(WIDE ** 3), blockValues = new Float32Array(WIDE ** 3);
    const met = new Uint8Array(26);
    /** Copies a brick and what is beside it. */
    const read = (): void => {
        for (let z = -1, to = 0; z <= 8; z++) {
            for (let y = -1; y <= 8; y++) {
                for (let x = -1; x <= 8; x++, to++) {
                    const at = around.at(x, y, z);
                    blockKinds[to] = at < 0 ? 0 : kinds[at];
                    if (at >= 0) blockValues[to] = values[at];
                }
            }
        }
    };
    /** Finds what is continued to a voxel of the block that has no kind. */
    const find = (middle: number): void => {
        let count = 0;
        for (let n = 0; n < 27; n++) {
            const at = middle + AWAY[n], kind = blockKinds[at];
            if (kind === 0) continue;
            let i = 0;
            while (i < count && met[i] !== kind) i++;
            if (i === count) {
                met[count++] = kind;
                sums[kind] = weights[kind] = 0;
            }
            sums[kind] += WEIGHTS[n] * blockValues[at];
            weights[kind] += WEIGHTS[n];
        }
        let most = met[0];
        for (let i = 1; i < count; i++) {
            const kind = met[i], more = weights[kind] - weights[most];
            if (more > 0 || (more === 0 && kind < most)) most = kind;
        }
        continued.push(Math.fround(sums[most] / weights[most]));
        found.push(most);
    };
    for (let layer = 0; layer < layers; layer++) {
        const begin = places.length;
        eachBrick(bricks, (x, y, z, number) => {
            const slot = slots[number];
            if (slot < 0) return;
            around.move(x, y, z);
            if (!around.near(set, near)) return;
            let isRead = false;
            for (let j = 0; j < ROWS; j++) {
                const wanted = near[j] & ~set[slot * ROWS + j];
                if (wanted && !isRead) read();
                isRead ||= wanted !== 0;
                for (let i = 0; wanted >> i > 0; i++) {
                    if (!((wanted >> i) & 1)) continue;
                    places.push(slot * SAMPLES + j * 8 + i);
                    find((((j >> 3) + 1) * WIDE + (j & 7) + 1) * WIDE + i + 1);
                }
            }
        });
        for (let i = begin; i < places.length; i++) {
            const at = places[i];
            own.push(values[at]);
            values[at] = continued[i];
            kinds[at] = found[i];
            set[at >> 3] |= 1 << (at & 7);
        }
    }
    /** How many voxels around each kind are darker than what is continued, less those that are brighter. */
    const darker = new Int32Array(256);
    own.forEach((value, i) => {
        if (value < continued[i]) darker[found[i]]++;
        if (value > continued[i]) darker[found[i]]--;
    });
    own.forEach((value, i) => {
        if (darker[found[i]] >= 0 ? value < continued[i] : value > continued[i]) values[places[i]] = value;
    });
}
