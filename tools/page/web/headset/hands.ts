// What the viewer's hands do, with controllers or without (as xr-app/src/headset/hands.rs and palm.rs).
import type { Vec3 } from '../types.ts';
import { dot, length, sub } from '../render/vectors.ts';
import { direction, forward, type Pose, poseOf, turned } from './pose.ts';

/** Squeeze from which a hand holds; it lets go below half of it. */
export const HOLDS = 0.6;
/** A pulse of what takes hold, of a click, and of what snaps: seconds and strength, 0 to 1. */
export const GRAB = [0.03, 0.5] as const, CLICK = [0.015, 0.3] as const, SNAP = [0.05, 0.9] as const;
/** Seconds that an open palm is shown before it counts. */
const SHOWN = 0.5;
/**
 * Cosines of the largest angle from the palm to the eyes, and from the gaze to the hand: to begin, and to
 * continue.
 */
const TOWARDS = [Math.cos(0.6), Math.cos(0.85)] as const;
/** Least and greatest distance of a palm from the eyes, metres. */
const REACH = [0.15, 0.75] as const;
/** Largest squeeze of an open hand. */
const OPEN = 0.3;
/**
 * A finger's span over the length of its bones: straight fingers have 1, those of a fist less than the
 * second.
 */
const STRAIGHT = 0.9, FIST = 0.5;

export interface Hand {
    /** The pose in which it holds things. */
    grip: Pose | null;
    /** The pose from which it points. */
    ray: Pose | null;
    /** Firmness of the grab, 0 to 1. */
    squeeze: number;
    /** True while the trigger is pulled, or the fingers pinch. */
    select: boolean;
    /** The thumbstick: to the right and up, -1 to 1. */
    stick: [number, number];
    /** The first and the second button, and that of the panel. */
    next: boolean;
    other: boolean;
    panel: boolean;
    /** True without a controller. */
    bare: boolean;
    /** The joints of each finger of a hand without a controller, from the wrist to the tip. */
    fingers: Vec3[][];
    source: XRInputSource | null;
}

/** The left and the right one. */
export type Hands = [Hand, Hand];

export const idle = (): Hand => ({
    grip: null, ray: null, squeeze: 0, select: false, stick: [0, 0], next: false, other: false, panel: false,
    bare: false, fingers: [], source: null,
});

/**
 * The hands at a frame. What points without being a hand, such as fingers on a telephone's screen, is first
 * the right one, then the left one.
 */
export function handsOf(frame: XRFrame, space: XRReferenceSpace, selecting: Set<XRInputSource>): Hands {
    const hands: Hands = [idle(), idle()];
    for (const source of frame.session.inputSources) {
        const { handedness } = source;
        const isLeft = handedness === 'left' || (handedness === 'none' && hands[1].source !== null);
        hands[isLeft ? 0 : 1] = handOf(source, frame, space, selecting.has(source));
    }
    return hands;
}

function handOf(source: XRInputSource, frame: XRFrame, space: XRReferenceSpace, selects: boolean): Hand {
    const pose = (of: XRSpace | undefined) => {
        const found = of && frame.getPose(of, space);
        return found ? poseOf(found.transform) : null;
    };
    const { buttons, axes } = source.gamepad ?? { buttons: [], axes: [] };
    const pressed = (button: number) => buttons[button]?.pressed ?? false;
    const ray = pose(source.targetRaySpace);
    const standard = source.gamepad?.mapping === 'xr-standard';
    const fingers = source.hand ? fingersOf(source.hand, frame, space) : [];
    return {
        grip: pose(source.gripSpace) ?? ray,
        ray,
        // Where nothing else grabs, that which selects does; so does a pinch of a bare hand, beside its
        // grasp.
        squeeze: Math.max(
            standard && buttons[1] ? buttons[1].value : selects ? 1 : 0,
            fingers.length ? graspOf(fingers) : 0,
        ),
        select: selects,
        stick: standard && axes.length > 3 ? [axes[2], -axes[3]] : [0, 0],
        next: standard && pressed(4),
        other: standard && pressed(5),
        panel: standard && pressed(3),
        bare: Boolean(source.hand),
        fingers,
        source,
    };
}

function fingersOf(hand: XRHand, frame: XRFrame, space: XRReferenceSpace): Vec3[][] {
    const fingers: Vec3[][] = [];
    let wrist: Vec3[] = [];
    for (const [name, joint] of hand) {
        const pose = frame.getJointPose?.(joint, space);
        if (!pose) return [];
        const { position } = poseOf(pose.transform);
        if (name === 'wrist') wrist = [position];
        else if (name.endsWith('metacarpal')) fingers.push([...wrist, position]);
        else fingers[fingers.length - 1].push(position);
    }
    return fingers;
}

/**
 * How firmly a hand grasps: how far its last three fingers are bent. The thumb and the first one may pinch.
 */
function graspOf(fingers: Vec3[][]): number {
    const span = fingers.slice(2).map((joints) => {
        const bones = joints.slice(2);
        const along = bones.slice(1).map((joint, i) => length(sub(joint, bones[i])));
        return length(sub(bones[bones.length - 1], bones[0])) / along.reduce((sum, part) => sum + part, 0);
    });
    const mean = span.reduce((sum, part) => sum + part, 0) / span.length;
    return Math.min(Math.max((STRAIGHT - mean) / (STRAIGHT - FIST), 0), 1);
}

/** Lets the controller in a hand vibrate, if it can. */
export function pulse({ source }: Hand, [seconds, strength]: readonly [number, number]): void {
    type Actuators = { hapticActuators?: { pulse?(strength: number, ms: number): unknown }[] };
    const pad = source?.gamepad as Actuators | undefined;
    pad?.hapticActuators?.[0]?.pulse?.(strength, seconds * 1000);
}

/** Tells whether a button has just been pressed. */
export class Button {
    #down = false;

    pressed(down: boolean): boolean {
        const pressed = down && !this.#down;
        this.#down = down;
        return pressed;
    }
}

/**
 * The gesture by which a hand without a controller calls the panel: its open palm before the eyes for half a
 * second. No pinch belongs to it, since headsets keep a pinch with the palm towards the face for themselves.
 */
export class Palm {
    #since: number | null = null;

    /**
     * True once the palm of the left (0) or right hand has been shown long enough, until it is turned away.
     */
    shown(hand: Hand, side: number, head: Pose, seconds: number): boolean {
        const cosine = TOWARDS[this.#since === null ? 0 : 1];
        if (!faces(hand, side, head, cosine)) this.#since = null;
        else this.#since ??= seconds;
        return this.#since !== null && seconds - this.#since >= SHOWN;
    }
}

function faces({ bare, squeeze, select, grip }: Hand, side: number, head: Pose, cosine: number): boolean {
    if (!bare || squeeze >= OPEN || select || !grip) return false;
    // +x of a grip goes out of the left palm, and into the right one.
    const palm = turned(grip.orientation, [side ? -1 : 1, 0, 0]);
    const eyes = sub(head.position, grip.position);
    const towards = direction(eyes, palm);
    const distance = length(eyes);
    return distance >= REACH[0] && distance < REACH[1] && dot(palm, towards) > cosine
        && -dot(forward(head), towards) > cosine;
}
