// How far rays can leap over what a look does not show (shaders-glsl/render/occupancy_mark.comp, occupancy_spread.comp).
import type { Atlas } from '../types.ts';
import type { LookTables } from './look.ts';

/** Largest distance, small bricks. */
const FARTHEST = 16;

/** For each small brick the Chebyshev distance to the nearest of which the look can show something, at most 16. */
export function distances({ leaps }: Atlas, { tables: [first], visibleBefore }: LookTables): Uint8Array {
    const { intervals, bricks: [nx, ny, nz] } = leaps;
    const count = nx * ny * nz;
    let from = new Uint8Array(count), to = new Uint8Array(count);
    const last = first.length - 1;
    for (let i = 0; i < count; i++) {
        const low = intervals[2 * i], high = intervals[2 * i + 1];
        from[i] = FARTHEST;
        if (low > high) continue;
        // The entries that intensities between them look up, and one more on each side.
        const a = Math.min(Math.max(Math.floor((low - first.first) / first.step), 0), last);
        const b = Math.min(Math.max(Math.ceil((high - first.first) / first.step), 0), last);
        if (visibleBefore[b + 1] > visibleBefore[a]) from[i] = 0;
    }
    // One axis after the other, the least max(|d|, distance of the brick d further along).
    for (const [stride, length] of [[1, nx], [nx, ny], [nx * ny, nz]]) {
        for (let i = 0, place = 0, within = 0; i < count; i++) {
            let nearest = from[i];
            const behind = length - 1 - place;
            for (let d = 1; d < nearest && (d <= place || d <= behind); d++) {
                if (d <= place) nearest = Math.min(nearest, Math.max(d, from[i - d * stride]));
                if (d <= behind) nearest = Math.min(nearest, Math.max(d, from[i + d * stride]));
            }
            to[i] = nearest;
            if (++within === stride) {
                within = 0;
                if (++place === length) place = 0;
            }
        }
        [from, to] = [to, from];
    }
    return from;
}
