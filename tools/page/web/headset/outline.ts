// The outline of a cutting plane: where it meets the box around the patient (as xr-app/src/outline.rs).
import type { Plane, Vec3 } from '../types.ts';
import { add, cross, dot, length, scaled, sub } from '../render/vectors.ts';
import { direction } from './pose.ts';

/**
 * Half the edge of the square that stands for a plane which does not meet the box, as a part of its diagonal.
 */
const BESIDE = 0.15;

/**
 * The corners of the polygon in which a plane meets a box, mm RAS, in their order round it. Where the two do
 * not meet it is a square around the plane's point that is nearest to `at`, so that the plane is seen beside
 * the patient, too.
 */
export function outline({ normal, offset }: Plane, [low, high]: [Vec3, Vec3], at: Vec3): Vec3[] {
    const above = (place: Vec3) => dot(normal, place) - offset;
    const right = direction(cross(normal, Math.abs(normal[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]), normal);
    const up = cross(normal, right);
    const corners: Vec3[] = [];
    for (let axis = 0; axis < 3; axis++) {
        for (let edge = 0; edge < 4; edge++) {
            const from = [...low] as Vec3;
            for (const side of [0, 1]) {
                const k = (axis + 1 + side) % 3;
                if ((edge >> side) & 1) from[k] = high[k];
            }
            const to = [...from] as Vec3;
            to[axis] = high[axis];
            const [before, after] = [above(from), above(to)];
            // An end that lies in the plane belongs to the edge that comes from above.
            if (before < 0 === after < 0) continue;
            corners.push(add(from, scaled(sub(to, from), before / (before - after))));
        }
    }
    if (corners.length < 3) {
        const nearest = sub(at, scaled(normal, above(at)));
        const half = BESIDE * length(sub(high, low));
        return [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(
            ([x, y]) => add(nearest, add(scaled(right, x * half), scaled(up, y * half))));
    }
    const middle = scaled(corners.reduce(add), 1 / corners.length);
    const angle = (place: Vec3) => Math.atan2(dot(sub(place, middle), up), dot(sub(place, middle), right));
    return corners.sort((one, other) => angle(one) - angle(other));
}
