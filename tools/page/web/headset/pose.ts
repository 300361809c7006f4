// Rotations and poses in the room, whose x goes to the viewer's right, y up, z towards the viewer; metres.
import type { Vec3 } from '../types.ts';
import { add, cross, dot, length, scaled } from '../render/vectors.ts';

/** A unit quaternion: x, y, z, w. */
export type Turn = [number, number, number, number];

export interface Pose {
    position: Vec3;
    orientation: Turn;
}

export const ORIGIN: Pose = { position: [0, 0, 0], orientation: [0, 0, 0, 1] };
export const UP: Vec3 = [0, 1, 0];
export const AHEAD: Vec3 = [0, 0, -1];

/** A vector of length 1, or another one where there is none. */
export function direction(v: Vec3, otherwise: Vec3): Vec3 {
    const size = length(v);
    return size > 1e-9 ? scaled(v, 1 / size) : otherwise;
}

/** A vector after a turn. */
export function turned([x, y, z, w]: Turn, v: Vec3): Vec3 {
    const axis: Vec3 = [x, y, z];
    const half = add(cross(axis, v), scaled(v, w));
    return add(v, scaled(cross(axis, half), 2));
}

/** The turn `b`, then the turn `a`. */
export function product(a: Turn, b: Turn): Turn {
    const [p, q]: Vec3[] = [[a[0], a[1], a[2]], [b[0], b[1], b[2]]];
    const both = [...add(add(scaled(q, a[3]), scaled(p, b[3])), cross(p, q)), a[3] * b[3] - dot(p, q)];
    // Products of many frames would drift away from length 1.
    const size = Math.hypot(...both);
    return both.map((part) => part / size) as Turn;
}

export const inverse = ([x, y, z, w]: Turn): Turn => [-x, -y, -z, w];

/** A turn about the vertical, radians, to the left. */
export const yaw = (angle: number): Turn => [0, Math.sin(angle / 2), 0, Math.cos(angle / 2)];

/** The shortest turn from one unit vector to another. */
export function arc(from: Vec3, to: Vec3): Turn {
    const cosine = dot(from, to);
    if (cosine < -1 + 1e-9) {
        const across = direction(cross(from, UP), [1, 0, 0]);
        return [...across, 0];
    }
    return product([...cross(from, to), 1 + cosine], [0, 0, 0, 1]);
}

export function poseOf({ position: p, orientation: o }: XRRigidTransform): Pose {
    return { position: [p.x, p.y, p.z], orientation: [o.x, o.y, o.z, o.w] };
}

export const forward = (pose: Pose): Vec3 => turned(pose.orientation, AHEAD);

/** A place in the room from one in the space of a pose. */
export const placed = (pose: Pose, at: Vec3): Vec3 => add(pose.position, turned(pose.orientation, at));

/** A direction without its part up or down. */
export const level = ([x, , z]: Vec3): Vec3 => direction([x, 0, z], AHEAD);
