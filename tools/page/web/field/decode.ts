// V and O of splats at the voxels of the grid that they were fitted on (engine/render/src/decoded).
import type { Vec3 } from '../types.ts';
import { eachBrick } from './bricks.ts';
import { MOST_BRICKS, ROWS, SAMPLES, WHOLE, bricksOf } from './field.ts';
import type { Field, Progress } from './field.ts';
import { GET_AGAIN, Refusal, tooLarge } from './refusal.ts';
import { joined } from './region.ts';
import type { Region } from './region.ts';
import { decodeRegion } from './shown.ts';
import {
    FAR, LEAST_WEIGHT, ROW, Strip, binned, boxAround, confine, footprintsOf, lead, limit, numbersOf,
    placeIn, slotsOf,
} from './sums.ts';
import type { Numbered } from './sums.ts';
import type { Grid, SplatSet } from './vgs.ts';

/** Why two sets do not add up to one field, as `join` (engine/splat/src/objects.rs) has it. */
function discord(a: SplatSet, b: SplatSet): string | null {
    const sameGrid = a.grid?.size.every((n, k) => n === b.grid?.size[k]) &&
        a.grid.affine.every((v, k) => v === b.grid?.affine[k]);
    const luminances = [a, b].map(({ unit }) => unit === 'luminance');
    if (luminances[0] !== luminances[1]) return 'one has luminances, the other intensities';
    if (!sameGrid) return 'they were fitted for the voxels of different grids';
    if ((a.form === 'grid') !== (b.form === 'grid')) return 'only one was fitted to a mask that is soft';
    const isJoined = ({ voxels, count }: SplatSet): boolean => voxels.length + (count > 0 ? 1 : 0) > 1;
    if (a.voxels.length + b.voxels.length > 0 && (isJoined(a) || isJoined(b))) return 'one is joined itself';
    // What is coded has no field of its own.
    if (a.count === 0 || b.count === 0) return null;
    if (a.kernel !== b.kernel) return `the kernel of one is ${a.kernel}, that of the other ${b.kernel}`;
    if (a.epsilon !== b.epsilon) return `ε of one is ${a.epsilon}, that of the other ${b.epsilon}`;
    const [w, other] = [a.occupancyW0, b.occupancyW0];
    return w === other ? null : `w₀ of one is ${w}, that of the other ${other}`;
}

function check(parts: Numbered[]): Grid {
    for (const { set } of parts) {
        if (!set.grid || set.form === 'field') {
            throw new Refusal('The splats were fitted for the field between the voxels too, which a page ' +
                'shows as voxels. Make the page again with the program.');
        }
        const why = discord(lead(parts), set);
        if (why) throw new Refusal(`The sets of splats cannot be one scene: ${why}. ${GET_AGAIN}`);
    }
    return parts[0].set.grid!;
}

/** Decodes sets that lie on one grid to its voxels. */
export function decodeSplats(parts: Numbered[], progress: Progress): Field {
    const grid = check(parts), background = meanBackground(parts), several = parts.length > 1;
    if (parts[0].set.form === 'grid') return decodeGrid(parts, false, progress);
    const regions = parts.map((part, i) => {
        const region = part.set.region ?? occupied(part.set), numberOf = numbersOf(part, several);
        const objects = region.objects.map(({ number, fit }) =>
            ({ number: numberOf[number], fit: several ? i : fit }));
        return { ...region, objects };
    });
    const coded = parts.flatMap(({ set }, i) =>
        set.voxels.map((values) => (several ? { ...values, fit: i } : values)));
    return decodeRegion(parts, joined(regions), coded, grid, background, progress);
}

/**
 * Decodes sets without a region: O is that of the splats, or if it is `binary` 1 where that is above one
 * half, and a voxel belongs to the object of most weight.
 */
function decodeGrid(parts: Numbered[], binary: boolean, progress: Progress): Field {
    const grid = parts[0].set.grid!, { kernel, epsilon, occupancyW0 } = parts[0].set;
    const background = meanBackground(parts);
    const prints = footprintsOf(parts, grid, background), { rows, boxes, numbers } = prints;
    const { low, size } = boxAround(prints, grid);
    limit(size);
    confine(prints, low, size);
    const bricks = bricksOf(size), { slots, used } = slotsOf(prints, low, size);
    if (used > MOST_BRICKS) throw tooLarge(`${Math.round(used * SAMPLES / 1e6)} million voxels`);
    const { starts, pairs } = binned(prints, prints.order, low, size);
    const several = new Set(numbers).size > 1;
    const values = new Float32Array(used * SAMPLES).fill(background);
    const occupancies = new Uint16Array(used * SAMPLES);
    const known = new Uint8Array(used * ROWS), there = new Uint8Array(used * ROWS);
    const width = bricks[0] * 8, strip = new Strip(width, [low[0] - 1, 0, 0]), { weights, sums } = strip;
    // Of several objects: Σ w of all, the most that one of them has of it, and that one.
    const all = several ? new Float64Array(width * 64) : weights;
    const most = new Float64Array(several ? width * 64 : 0);
    const winners = new Uint8Array(several ? width * 64 : 0), label = numbers[prints.order[0]];
    const labels = several ? new Uint8Array(used * SAMPLES).fill(label) : null;
    /** Adds what the splats of an object, those of some pairs, gave to the voxels of the strip. */
    const settle = (begin: number, end: number): void => {
        const number = numbers[pairs[begin]];
        let x0 = FAR, x1 = 0;
        for (let p = begin; p < end; p++) {
            x0 = Math.min(x0, boxes[pairs[p] * 6]);
            x1 = Math.max(x1, boxes[pairs[p] * 6 + 3]);
        }
        for (let j = 0; j < 64; j++) {
            const line = j * width + 1 - low[0];
            for (let i = line + x0; i <= line + x1; i++) {
                const w = weights[i];
                all[i] += w;
                if (w > most[i]) {
                    most[i] = w;
                    winners[i] = number;
                }
                weights[i] = 0;
            }
        }
    };
    let least = background, greatest = background;
    /** Takes the sums of a brick of the strip, and clears them. */
    const take = (x: number, y: number, z: number, slot: number): void => {
        const x0 = x * 8 + low[0] - 1, y0 = y * 8 + low[1] - 1, z0 = z * 8 + low[2] - 1;
        for (let j = 0; j < ROWS; j++) {
            const vy = y0 + (j & 7), vz = z0 + (j >> 3);
            const inRow = vy >= 0 && vy < grid.size[1] && vz >= 0 && vz < grid.size[2];
            let at = j * width + x * 8, knownBits = 0, thereBits = 0;
            for (let i = 0; i < 8; i++, at++) {
                const weight = all[at];
                if (weight === 0) continue;
                if (weight >= LEAST_WEIGHT) {
                    const v = Math.fround(background + sums[at] / (weight + epsilon));
                    const to = slot * SAMPLES + j * 8 + i;
                    values[to] = v;
                    knownBits |= 1 << i;
                    if (labels) labels[to] = winners[at];
                    if (inRow && x0 + i >= 0 && x0 + i < grid.size[0]) {
                        if (v < least) least = v;
                        if (v > greatest) greatest = v;
                        // Rounded as the program does, so that the same voxels lie above one half.
                        const rounded = Math.fround(weight);
                        const o = Math.fround(rounded / Math.fround(rounded + occupancyW0));
                        const part = binary ? (o > 0.5 ? WHOLE : 0) : Math.round(o * WHOLE);
                        occupancies[to] = part;
                        if (part > 0) thereBits |= 1 << i;
                    }
                }
                all[at] = sums[at] = 0;
                if (several) most[at] = 0;
            }
            known[slot * ROWS + j] = knownBits;
            there[slot * ROWS + j] = thereBits;
        }
    };
    for (let row = 0; row < starts.length - 1; row++) {
        const y = row % bricks[1], z = Math.floor(row / bricks[1]);
        if (row % 16 === 0) progress('decoding', row / (starts.length - 1));
        strip.move(y * 8 + low[1] - 1, z * 8 + low[2] - 1);
        let begin = starts[row];
        for (let p = begin; p < starts[row + 1]; p++) {
            const i = pairs[p];
            strip.add(kernel, rows, i * ROW, boxes, i * 6);
            if (several && (p + 1 === starts[row + 1] || numbers[pairs[p + 1]] !== numbers[i])) {
                settle(begin, p + 1);
                begin = p + 1;
            }
        }
        for (let x = 0; x < bricks[0]; x++) {
            const slot = slots[row * bricks[0] + x];
            if (slot >= 0) take(x, y, z, slot);
        }
    }
    return {
        size, bricks, slots, values, occupancies, known, there, labels, label, ...placeIn(grid, low),
        range: [least, greatest],
        background,
        splats: numbers.length,
    };
}

/**
 * The region of a set of version 1: where the occupancy is above one half, but for exceptions; each voxel
 * belongs to the label of most weight.
 */
function occupied(set: SplatSet): Region {
    const field = decodeGrid([{ set, numbers: [] }], true, () => {}), { exceptions } = set;
    const { bricks, slots, there, labels, label, faces: [away] } = field;
    for (let i = 0; i < exceptions.length; i += 4) {
        const [x, y, z] = [0, 1, 2].map((k) => exceptions[i + k] + away[k] + 1);
        const within = [x, y, z].every((p, k) => p >= 0 && p >> 3 < bricks[k]);
        const slot = within ? slots[((z >> 3) * bricks[1] + (y >> 3)) * bricks[0] + (x >> 3)] : -1;
        const row = slot * ROWS + (z & 7) * 8 + (y & 7), bit = 1 << (x & 7);
        if (slot < 0 || !(field.known![row] & bit)) continue;
        there[row] = exceptions[i + 3] ? there[row] | bit : there[row] & ~bit;
    }
    const each = (tell: (voxel: number[], label: number) => void): void => {
        eachBrick(bricks, (x, y, z, number) => {
            for (let i = slots[number] * SAMPLES, j = 0; i >= 0 && j < SAMPLES; i++, j++) {
                if (!((there[i >> 3] >> (i & 7)) & 1)) continue;
                const place = [x * 8 + (j & 7), y * 8 + ((j >> 3) & 7), z * 8 + (j >> 6)];
                tell(place.map((p, k) => p - 1 - away[k]), labels ? labels[i] : label);
            }
        });
    };
    const first = [FAR, FAR, FAR], end = [0, 0, 0], found = new Set<number>();
    each((voxel, label) => {
        found.add(label);
        voxel.forEach((v, k) => {
            first[k] = Math.min(first[k], v);
            end[k] = Math.max(end[k], v + 1);
        });
    });
    if (found.size === 0) return { first: [0, 0, 0], size: [0, 0, 0], kinds: new Uint8Array(0), objects: [] };
    const size = end.map((v, k) => v - first[k]), kinds = new Uint8Array(size[0] * size[1] * size[2]);
    const all = [...found].sort((a, b) => a - b), kindOf = new Map(all.map((label, i) => [label, i + 1]));
    each((voxel, label) => {
        const [x, y, z] = voxel.map((v, k) => v - first[k]);
        kinds[(z * size[1] + y) * size[0] + x] = kindOf.get(label)!;
    });
    const objects = all.map((number) => ({ number, fit: 0 }));
    return { first: first as Vec3, size: size as Vec3, kinds, objects };
}

/** The mean of the backgrounds of all splats. */
function meanBackground(parts: Numbered[]): number {
    const first = parts[0].set.background;
    const count = parts.reduce((sum, { set }) => sum + set.count, 0);
    if (count === 0 || parts.every(({ set }) => set.background === first)) return first;
    return Math.fround(parts.reduce((sum, { set }) => sum + set.background * set.count, 0) / count);
}
