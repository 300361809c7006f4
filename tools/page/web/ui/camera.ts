// Cameras and how they move. As in the desktop viewer the patient's head stays up unless two fingers roll the
// picture.
import { cross, dot, scaled, sub, unit } from '../render/vectors.ts';
import type { Camera, Vec3, View } from '../types.ts';
import { along, clamp, distance } from './vectors.ts';

/** Range of the distance from the pivot, mm. */
const DISTANCES = [1, 1e6] as const;
/** Factor of the distance at which a scene just fits the picture, to leave a border. */
const MARGIN = 1.05;

/** A camera as angles (radians) about its target. */
export interface Orbit {
    pivot: Vec3;
    /** mm */
    distance: number;
    /** Of the eye about the body's axis: 0 in front, π/2 at the patient's left. */
    azimuth: number;
    /** Of the eye above the pivot: π/2 at the head. */
    elevation: number;
    /** Of the camera, anticlockwise. */
    roll: number;
    /** Degrees. */
    fieldOfView: number;
}

export type Side = 'anterior' | 'posterior' | 'left' | 'right' | 'superior' | 'inferior';
/** Azimuth and elevation of each side, degrees. From above and below the front of the patient is up. */
const ANGLES: Record<Side, [number, number]> = {
    anterior: [0, 0],
    posterior: [180, 0],
    left: [90, 0],
    right: [-90, 0],
    superior: [180, 90],
    inferior: [0, -90],
};
export const SIDES = Object.keys(ANGLES) as Side[];

/** Unit vectors to the right, upwards and towards the viewer, RAS. */
export function axesOf(camera: Camera): [Vec3, Vec3, Vec3] {
    const back = unit(sub(camera.eye, camera.target));
    const right = unit(cross(camera.up, back));
    return [right, cross(back, right), back];
}

/** Axes without roll. */
function upright(azimuth: number, elevation: number): [Vec3, Vec3, Vec3] {
    const around: Vec3 = [-Math.sin(azimuth), Math.cos(azimuth), 0];
    const [sine, cosine] = [Math.sin(elevation), Math.cos(elevation)];
    return [
        [-Math.cos(azimuth), -Math.sin(azimuth), 0],
        along([0, 0, cosine], around, -sine),
        along([0, 0, sine], around, cosine),
    ];
}

export function orbitOf(camera: Camera): Orbit {
    const [, up, back] = axesOf(camera);
    const elevation = Math.atan2(back[2], Math.hypot(back[0], back[1]));
    // Above head and feet the azimuth is told by what is up in the picture.
    const polar = Math.hypot(back[0], back[1]) < 1e-6;
    const around = polar ? scaled(up, -Math.sign(back[2])) : back;
    const azimuth = Math.atan2(-around[0], around[1]);
    const [r, u] = upright(azimuth, elevation);
    return {
        pivot: camera.target,
        distance: distance(camera.eye, camera.target),
        azimuth,
        elevation,
        roll: polar ? 0 : Math.atan2(-dot(up, r), dot(up, u)),
        fieldOfView: camera.fieldOfView,
    };
}

export function cameraOf(orbit: Orbit): Camera {
    const [right, up, back] = upright(orbit.azimuth, orbit.elevation);
    const turned = along(scaled(up, Math.cos(orbit.roll)), right, -Math.sin(orbit.roll));
    const { pivot, fieldOfView } = orbit;
    return { eye: along(pivot, back, orbit.distance), target: pivot, up: turned, fieldOfView };
}

/**
 * Half the height and half the width of a picture at depth 1. The field of view lies across the shorter side.
 */
function halves(camera: Camera, aspect: number): [number, number] {
    const half = Math.tan((camera.fieldOfView * Math.PI) / 360);
    return aspect < 1 ? [half, half / aspect] : [half * aspect, half];
}

/** What is seen in a picture `aspect` times as wide as high. */
export function viewOf(camera: Camera, aspect: number): View {
    const [right, up, back] = axesOf(camera);
    const [x, y] = halves(camera, aspect);
    return { eye: camera.eye, right, up, forward: scaled(back, -1), tangents: [-x, x, y, -y] };
}

/**
 * Turns about the pivot by radians; the eye goes to the patient's left and upwards, as seen in the picture.
 */
export function turned(camera: Camera, across: number, upwards: number): Camera {
    const orbit = orbitOf(camera);
    const [sine, cosine] = [Math.sin(orbit.roll), Math.cos(orbit.roll)];
    orbit.azimuth += across * cosine - upwards * sine;
    orbit.elevation = clamp(orbit.elevation + across * sine + upwards * cosine, -Math.PI / 2, Math.PI / 2);
    return cameraOf(orbit);
}

/** Turns the camera anticlockwise by radians, and so the picture clockwise. */
export function rolled(camera: Camera, by: number): Camera {
    const orbit = orbitOf(camera);
    return cameraOf({ ...orbit, roll: orbit.roll + by });
}

/** mm at the pivot's depth for each part of the picture's shorter side. */
export const heightOf = (camera: Camera): number =>
    2 * distance(camera.eye, camera.target) * Math.tan((camera.fieldOfView * Math.PI) / 360);

/** Moves the scene at the pivot's depth to the right and upwards, in shorter sides of the picture. */
export function panned(camera: Camera, x: number, y: number): Camera {
    const [right, up] = axesOf(camera);
    const height = heightOf(camera);
    const by = along(scaled(right, -x * height), up, -y * height);
    return { ...camera, eye: along(camera.eye, by), target: along(camera.target, by) };
}

/**
 * Multiplies the distance. What lies at the pivot's depth at (x, y), shorter sides of the picture to the
 * right of and above its middle, stays there.
 */
export function zoomed(camera: Camera, factor: number, x: number, y: number): Camera {
    const before = distance(camera.eye, camera.target);
    const after = clamp(before * factor, DISTANCES[0], DISTANCES[1]);
    const back = unit(sub(camera.eye, camera.target));
    const near = { ...camera, eye: along(camera.target, back, after) };
    const rest = before / after - 1;
    return panned(near, -rest * x, -rest * y);
}

export function from(camera: Camera, side: Side): Camera {
    const [azimuth, elevation] = ANGLES[side].map((degrees) => (degrees * Math.PI) / 180);
    return cameraOf({ ...orbitOf(camera), azimuth, elevation, roll: 0 });
}

/** Takes another pivot: the eye moves across until it is in the middle of the picture, and no nearer. */
export function about(camera: Camera, pivot: Vec3): Camera {
    const by = sub(pivot, camera.target);
    const [, , back] = axesOf(camera);
    const shift = along(by, back, -dot(by, back));
    return { ...camera, eye: along(camera.eye, shift), target: pivot };
}

/** Looks at the middle of points from as near as all of them allow. */
export function fitted(camera: Camera, points: Vec3[], aspect: number): Camera {
    const [right, up, back] = axesOf(camera);
    const [x, y] = halves(camera, aspect);
    const middle = scaled(
        points.reduce((sum, p) => along(sum, p), [0, 0, 0] as Vec3),
        1 / points.length,
    );
    const needed = points.map((point) => {
        const p = sub(point, middle);
        return Math.max(Math.abs(dot(p, right)) / x, Math.abs(dot(p, up)) / y) * MARGIN + dot(p, back);
    });
    const far = clamp(Math.max(...needed), DISTANCES[0], DISTANCES[1]);
    return { ...camera, target: middle, eye: along(middle, back, far) };
}

/** Where points are seen, in pixels from the upper left corner; null: not before the eye. */
export function projection(
    camera: Camera,
    width: number,
    height: number,
): (p: Vec3) => [number, number] | null {
    const [right, up, back] = axesOf(camera);
    const [x, y] = halves(camera, width / height);
    return (p) => {
        const d = sub(p, camera.eye);
        const depth = -dot(d, back);
        if (depth < 1e-3) return null;
        return [
            (0.5 + dot(d, right) / (2 * x * depth)) * width,
            (0.5 - dot(d, up) / (2 * y * depth)) * height,
        ];
    };
}

/** A camera on the way from one to another; 0: the first, 1: the second. */
export function between(a: Camera, b: Camera, share: number): Camera {
    const [p, q] = [orbitOf(a), orbitOf(b)];
    const angle = (x: number, y: number) => x + Math.atan2(Math.sin(y - x), Math.cos(y - x)) * share;
    return cameraOf({
        pivot: along(p.pivot, sub(q.pivot, p.pivot), share),
        distance: p.distance * (q.distance / p.distance) ** share,
        azimuth: angle(p.azimuth, q.azimuth),
        elevation: angle(p.elevation, q.elevation),
        roll: angle(p.roll, q.roll),
        fieldOfView: p.fieldOfView + (q.fieldOfView - p.fieldOfView) * share,
    });
}
