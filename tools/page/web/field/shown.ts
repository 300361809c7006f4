// Splats with a region: what is shown are its voxels, with smooth edges; the splats, or coded voxels in their
// place, say what V is in them (engine/render/src/decoded/region.rs).
import type { Vec3 } from '../types.ts';
import { extend } from './beyond.ts';
import { Around, bricksNear } from './bricks.ts';
import { MARGIN, REACH, RUN, occupancy } from './edges.ts';
import { MOST_BRICKS, ROWS, SAMPLES, WHOLE, bricksOf } from './field.ts';
import type { Field, Progress } from './field.ts';
import { tooLarge } from './refusal.ts';
import type { Region } from './region.ts';
import { LEAST_WEIGHT, ROW, Strip, binned, confine, footprintsOf, lead, limit, placeIn } from './sums.ts';
import type { Numbered } from './sums.ts';
import { valueAt } from './values.ts';
import type { Values } from './values.ts';
import type { Grid } from './vgs.ts';

/** Voxels beyond the region whose V interpolation needs where O is not 0. */
const LAYERS = 2;

/** A box around a region, and what of it is in bricks. */
interface Shown {
    /** Voxel of the grid that is the first of the box. */
    low: Vec3;
    size: Vec3;
    bricks: Vec3;
    slots: Int32Array;
    /** Kind of the voxels of each slot, and where it is one. */
    kinds: Uint8Array;
    inside: Uint8Array;
}

function shownOf({ first, size: extent, kinds }: Region): Shown {
    // As much as the program takes.
    limit(extent.map((n) => n + 4) as Vec3);
    const low = first.map((v) => v - MARGIN + 1) as Vec3;
    const size = extent.map((n) => n + 2 * MARGIN - 1) as Vec3;
    size[0] = Math.ceil((size[0] + 1) / RUN) * RUN - 1;
    const bricks = bricksOf(size), slots = new Int32Array(bricks[0] * bricks[1] * bricks[2]).map((_, i) => i);
    const boxes = new Int8Array(slots.length * 6).map((_, i) => (i % 6 < 3 ? 8 : -1));
    /** Calls `each` with every voxel that has a kind: its brick, and its place there. */
    const everyVoxel = (each: (brick: number, place: number, kind: number) => void): void => {
        for (let z = MARGIN, i = 0; z < MARGIN + extent[2]; z++) {
            for (let y = MARGIN; y < MARGIN + extent[1]; y++) {
                const line = ((z >> 3) * bricks[1] + (y >> 3)) * bricks[0], row = (z & 7) * 64 + (y & 7) * 8;
                for (let x = MARGIN; x < MARGIN + extent[0]; x++, i++) {
                    if (kinds[i]) each(line + (x >> 3), row + (x & 7), kinds[i]);
                }
            }
        }
    };
    everyVoxel((brick, place) => {
        for (let k = 0, at = brick * 6; k < 3; k++, at++) {
            const v = (place >> (3 * k)) & 7;
            if (v < boxes[at]) boxes[at] = v;
            if (v > boxes[at + 3]) boxes[at + 3] = v;
        }
    });
    const wanted = bricksNear({ bricks, slots }, boxes, REACH, REACH);
    const voxels = wanted.length * SAMPLES;
    if (wanted.length > MOST_BRICKS) throw tooLarge(`${Math.round(voxels / 1e6)} million voxels`);
    slots.fill(-1);
    wanted.forEach((number, slot) => (slots[number] = slot));
    const own = new Uint8Array(wanted.length * SAMPLES), inside = new Uint8Array(wanted.length * ROWS);
    everyVoxel((brick, place, kind) => {
        const at = slots[brick] * SAMPLES + place;
        own[at] = kind;
        inside[at >> 3] |= 1 << (at & 7);
    });
    return { low, size, bricks, slots, kinds: own, inside };
}

/** Decodes sets that have this region together; `coded` is what they have in place of splats. */
export function decodeRegion(
    parts: Numbered[], region: Region, coded: Values[], grid: Grid, background: number, progress: Progress,
): Field {
    const { kernel, epsilon } = lead(parts), { objects } = region;
    const prints = footprintsOf(parts, grid, background), { rows, boxes, numbers } = prints;
    const shown = shownOf(region), { low, size, bricks, slots, kinds, inside } = shown;
    confine(prints, low, size);
    const shares = occupancy(shown, inside, size), occupancies = new Uint16Array(shares.length);
    const values = new Float32Array(kinds.length).fill(NaN), there = new Uint8Array(inside.length);
    /** The kind of the voxels whose V is known. */
    const known = new Uint8Array(kinds.length);
    const counts = new Uint32Array(objects.length + 1), fitOf = new Map<number, number>();
    for (let i = 0; i < kinds.length; i++) counts[kinds[i]]++;
    // Splats of an object without voxels count in every fit.
    objects.forEach(({ number, fit }, i) => {
        if (counts[i + 1] > 0 && !fitOf.has(number)) fitOf.set(number, fit);
    });
    // Voxel of the grid at the first place of the first brick.
    const away = low.map((v) => v - 1);
    const strip = new Strip(bricks[0] * 8, [away[0], 0, 0]), { weights, sums, width } = strip;
    const around = new Around(shown), near = new Uint8Array(ROWS);
    const fits = [...new Set(objects.map(({ fit }) => fit))].sort((a, b) => a - b);
    fits.forEach((fit, turn) => {
        const isOwn = [false, ...objects.map((object) => object.fit === fit)];
        const own = new Uint8Array(inside.length);
        for (let i = 0; i < kinds.length; i++) if (isOwn[kinds[i]]) own[i >> 3] |= 1 << (i & 7);
        const given = coded.find((values) => values.fit === fit);
        const order = prints.order.filter((i) => !given && (fitOf.get(numbers[i]) ?? fit) === fit);
        const { starts, pairs } = binned(prints, order, low, size);
        /** Takes V where it is that of this fit, and in the rim around. */
        const take = (x: number, y: number, z: number, slot: number): void => {
            around.move(x, y, z);
            if (!around.near(own, near)) return;
            const [vx, vy, vz] = [x, y, z].map((brick, k) => brick * 8 + away[k]);
            for (let j = 0; j < ROWS; j++) {
                const row = slot * ROWS + j, rim = near[j] & ~inside[row], wanted = rim | own[row];
                for (let i = 0; wanted >> i > 0; i++) {
                    const at = j * width + x * 8 + i, to = row * 8 + i, weight = weights[at];
                    if (!((wanted >> i) & 1) || !Number.isNaN(values[to])) continue;
                    const value = given ? valueAt(given, vx + i, vy + (j & 7), vz + (j >> 3))
                        : weight < LEAST_WEIGHT ? NaN : background + sums[at] / (weight + epsilon);
                    if (Number.isNaN(value)) continue;
                    values[to] = value;
                    known[to] = kinds[to];
                }
            }
        };
        for (let row = 0; row < starts.length - 1; row++) {
            const y = row % bricks[1], z = Math.floor(row / bricks[1]);
            if (row % 16 === 0) progress('decoding', (turn + row / (starts.length - 1)) / fits.length);
            if (!given && starts[row] === starts[row + 1]) continue;
            strip.move(y * 8 + away[1], z * 8 + away[2]);
            for (let p = starts[row]; p < starts[row + 1]; p++) {
                strip.add(kernel, rows, pairs[p] * ROW, boxes, pairs[p] * 6);
            }
            for (let x = 0; x < bricks[0]; x++) {
                const slot = slots[row * bricks[0] + x];
                if (slot >= 0) take(x, y, z, slot);
            }
            weights.fill(0);
            sums.fill(0);
        }
    });
    // What V is in the rim is known, so what is farther out continues it.
    for (const layers of [1, LAYERS - 1]) extend({ bricks, slots, values }, known, layers);
    const label = objects[0]?.number ?? 0;
    const labels = objects.length > 1 ? new Uint8Array(kinds.length).fill(label) : null;
    let least = background, greatest = background;
    for (let i = 0; i < kinds.length; i++) {
        // A voxel that no splat reaches stays its object's.
        const kind = kinds[i] || known[i];
        if (kind > 0) occupancies[i] = shares[i] * (WHOLE / 255);
        if (kind === 0 || Number.isNaN(values[i])) values[i] = background;
        if (occupancies[i] > 0) there[i >> 3] |= 1 << (i & 7);
        if (values[i] < least) least = values[i];
        if (values[i] > greatest) greatest = values[i];
        if (labels && kind > 0) labels[i] = objects[kind - 1].number;
    }
    return {
        size, bricks, slots, values, occupancies, known: null, there, labels, label, ...placeIn(grid, low),
        range: [least, greatest],
        background,
        splats: numbers.length,
    };
}
