// Where the patient stands in the room, and how large (as xr-app/src/placement.rs).
import type { Vec3, View } from '../types.ts';
import { add, length, scaled, sub } from '../render/vectors.ts';
import {
    arc, direction, forward, inverse, level, type Pose, poseOf, product, type Turn, turned, yaw,
} from './pose.ts';

const MM = 1000;
/** Smallest and greatest magnification. */
const SCALES = [0.05, 50] as const;
/** Distance from the head to the patient's middle at the start, metres; greater for a large patient. */
const REACH = 0.6;
/** The patient's right at the viewer's left, the front towards the viewer, the head up. */
const FACING: Turn = [0, Math.SQRT1_2, Math.SQRT1_2, 0];

export interface Placement {
    /** The patient's point that stays with `position`, mm RAS. */
    centre: Vec3;
    /** Place of that point in the room, metres. */
    position: Vec3;
    /** From the patient's axes to those of the room. */
    orientation: Turn;
    /** Magnification; 1: real size. */
    scale: number;
}

/** In real size and upright before a head, the face to the viewer; `radius` in mm. */
export function before(head: Pose, centre: Vec3, radius: number): Placement {
    const ahead = level(forward(head));
    return {
        centre,
        position: add(head.position, scaled(ahead, Math.max(REACH, (1.5 * radius) / MM))),
        orientation: product(yaw(Math.atan2(-ahead[0], -ahead[2])), FACING),
        scale: 1,
    };
}

/** The place in the room of a point of the patient, mm RAS. */
export const roomOf = (p: Placement, mm: Vec3): Vec3 =>
    add(p.position, turned(p.orientation, scaled(sub(mm, p.centre), p.scale / MM)));

/** The point of the patient, mm RAS, at a place in the room. */
export const patientOf = (p: Placement, room: Vec3): Vec3 =>
    add(p.centre, scaled(patientDirection(p, sub(room, p.position)), MM / p.scale));

/** A direction of the room in the patient. */
export const patientDirection = (p: Placement, room: Vec3): Vec3 => turned(inverse(p.orientation), room);

/** After a hand has carried the patient from one pose to the next. */
export function carried(p: Placement, from: Pose, to: Pose): Placement {
    const turn = product(to.orientation, inverse(from.orientation));
    return {
        ...p,
        position: add(to.position, turned(turn, sub(p.position, from.position))),
        orientation: product(turn, p.orientation),
    };
}

/** The magnification after two hands have stretched the patient, who had `scale` before. */
export function stretchedScale(scale: number, from: [Vec3, Vec3], to: [Vec3, Vec3]): number {
    const wanted = (scale * length(sub(to[1], to[0]))) / length(sub(from[1], from[0]));
    return wanted > 0 && Number.isFinite(wanted) ? Math.min(Math.max(wanted, SCALES[0]), SCALES[1]) : scale;
}

/**
 * After two hands have stretched the patient: turned with the line between them, at a magnification, moved
 * with their middle. Two points say nothing of a turn about their line.
 */
export function stretched(p: Placement, from: [Vec3, Vec3], to: [Vec3, Vec3], scale: number): Placement {
    const [a, b] = [sub(from[1], from[0]), sub(to[1], to[0])];
    if (length(a) < 1e-9 || length(b) < 1e-9) return p;
    const turn = arc(direction(a, a), direction(b, b));
    const [old, now] = [from, to].map(([left, right]) => scaled(add(left, right), 0.5));
    return {
        ...p,
        position: add(now, scaled(turned(turn, sub(p.position, old)), scale / p.scale)),
        orientation: product(turn, p.orientation),
        scale,
    };
}

/** What an eye of the headset sees of the patient. Its frustum need not be symmetric. */
export function viewOf(p: Placement, { transform, projectionMatrix: m }: XRView): View {
    const { position, orientation } = poseOf(transform);
    const axis = (x: number, y: number, z: number) => patientDirection(p, turned(orientation, [x, y, z]));
    return {
        eye: patientOf(p, position),
        right: axis(1, 0, 0),
        up: axis(0, 1, 0),
        forward: axis(0, 0, -1),
        tangents: [(m[8] - 1) / m[0], (m[8] + 1) / m[0], (m[9] + 1) / m[5], (m[9] - 1) / m[5]],
    };
}
