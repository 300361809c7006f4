// Pointing at the panel: hands click on it, carry it by its frame, show it and hide it (as
// xr-app/src/pointing.rs).
import type { Vec3 } from '../types.ts';
import { add, cross, dot, scaled, sub } from '../render/vectors.ts';
import type { Controls } from './controls.ts';
import { Button, CLICK, GRAB, type Hand, type Hands, HOLDS, Palm, pulse } from './hands.ts';
import { HEIGHT, type Panel, type Point, WIDTH } from './panel.ts';
import { roomOf } from './placement.ts';
import { AHEAD, forward, inverse, level, type Pose, placed, product, turned, UP, yaw } from './pose.ts';
import { type Colour, facing, met, onPlane, type Plane, POINT, type Sheets } from './sheets.ts';

/** Distance of the panel's middle from a head, and how far it is below its eyes, metres. */
const BESIDE = 0.65, BELOW = 0.08;
/**
 * Least and greatest angle from straight ahead to its middle, radians, and that between it and the patient.
 */
const ASIDE = [0.45, 1.1] as const, GAP = 0.06;
/** Width of the frame by which it is carried, points. */
const FRAME = 34;
/** Length of a ray that meets nothing, metres. */
const BEAM = 1.5;
export const ACCENT: Colour = [0.34, 0.61, 0.84, 1];
const GREY: Colour = [0.38, 0.38, 0.38, 1], WHITE: Colour = [1, 1, 1, 1];

interface Met extends Point {
    /** From the hand, metres. */
    distance: number;
    onFrame: boolean;
}

export class Pointing {
    /** The plane of the panel, while it is shown. */
    place: Plane | null = null;
    /** Where the hand that points is on the panel. */
    pointer: Point | null = null;
    readonly #panel: Panel;
    readonly #controls: Controls;
    #toggles = [new Button(), new Button()];
    #palms = [new Palm(), new Palm()];
    #selects = [new Button(), new Button()];
    #grasps = [new Button(), new Button()];
    /** The hand that carries the panel, and its ray in the frame before. */
    #carrying: { side: number; ray: Pose } | null = null;
    /** The hand that points: the one that clicked last. */
    #active = 1;
    #mets: (Met | null)[] = [];

    constructor(panel: Panel, controls: Controls) {
        this.#panel = panel;
        this.#controls = controls;
    }

    /** Shows the panel before a head, at the left of the patient, or hides it. */
    toggle(head: Pose): void {
        const { placement, app } = this.#controls;
        this.place = this.place ? null : beside(head, app.corners.map((mm) => roomOf(placement, mm)));
        this.#carrying = null;
    }

    /**
     * Finds what hands point at and does what they mean there. Returns the hands as everything else should
     * see them.
     */
    point(hands: Hands, head: Pose, time: number, seconds: number): Hands {
        const panel = this.#panel, controls = this.#controls;
        hands.forEach((hand, side) => {
            const palm = this.#palms[side].shown(hand, side, head, time);
            if (this.#toggles[side].pressed(hand.panel || palm)) this.toggle(head);
        });
        const clicked = hands.map((hand, side) => this.#selects[side].pressed(hand.select));
        if (!panel.isPressed && clicked.includes(true)) this.#active = clicked.indexOf(true);
        this.#mets = hands.map((hand) => this.#met(hand));
        this.#carry(hands, head);
        // A hand on the panel points, whichever hand it is.
        const other = 1 - this.#active;
        if (!panel.isPressed && !this.#mets[this.#active] && this.#mets[other]) this.#active = other;
        const hand = hands[this.#active];
        const at = this.#mets[this.#active];
        const inside = at && !at.onFrame && !this.#carrying && !controls.holds(this.#active) ? at : null;
        this.pointer = inside;
        if (inside && clicked[this.#active]) pulse(hand, CLICK);
        // What is dragged goes on beside the panel.
        const drags = panel.isPressed || clicked[this.#active] ? hand.select : false;
        panel.press(drags ? (inside ?? (panel.isPressed ? this.#met(hand, Infinity) : null)) : null);
        if (inside) panel.stick(hand.stick[1], seconds);
        return hands.map((one, side) => this.#freed(one, side, drags)) as Hands;
    }

    /**
     * A hand without what was meant for the panel: there it grabs nothing, unless it holds the patient
     * already.
     */
    #freed(hand: Hand, side: number, drags: boolean): Hand {
        const meant = this.#mets[side] || this.#carrying?.side === side || (drags && side === this.#active);
        if (!meant || this.#controls.holds(side)) return hand;
        return { ...hand, squeeze: 0, stick: [0, 0] };
    }

    /** Carries the panel with a hand that takes hold of its frame. */
    #carry(hands: Hands, head: Pose): void {
        hands.forEach((hand, side) => {
            const begins = this.#grasps[side].pressed(hand.squeeze >= HOLDS);
            if (!begins || this.#carrying || !this.#mets[side]?.onFrame) return;
            this.#carrying = { side, ray: hand.ray! };
            pulse(hand, GRAB);
        });
        if (!this.#carrying || !this.place) return;
        const { side, ray: from } = this.#carrying;
        const { ray: to, squeeze } = hands[side];
        if (!to || squeeze < HOLDS / 2) {
            this.#carrying = null;
            return;
        }
        this.#carrying.ray = to;
        const turn = product(to.orientation, inverse(from.orientation));
        const middle = onPlane(this.place, WIDTH / 2, HEIGHT / 2);
        this.place = upright(add(to.position, turned(turn, sub(middle, from.position))), head);
        this.#mets[side] = this.#met(hands[side]);
    }

    /** The point of the panel, or of the frame around it, that a hand points at. */
    #met({ ray }: Hand, around = FRAME): Met | null {
        const at = this.place && ray && met(this.place, ray);
        if (!at) return null;
        const beyond = Math.max(-at.x, -at.y, at.x - WIDTH, at.y - HEIGHT);
        return beyond <= around ? { ...at, onFrame: beyond > 0 } : null;
    }

    /** Adds the panel, its frame and the rays of the hands. */
    show(sheets: Sheets, hands: Hands, eye: Vec3): void {
        const { place } = this;
        if (!place) return;
        sheets.rectangle(place, [0, 0, WIDTH, HEIGHT]);
        const bright = this.#carrying || this.#mets.some((at) => at?.onFrame);
        const colour = bright ? ACCENT : GREY;
        const [low, right, bottom] = [-FRAME / 2, WIDTH + FRAME / 2, HEIGHT + FRAME / 2];
        const ends: [number, number][] = [[low, low], [right, low], [right, bottom], [low, bottom]];
        ends.forEach(([x, y], i) => {
            const next = ends[(i + 1) % 4];
            sheets.line(onPlane(place, x, y), onPlane(place, ...next), eye, 3, colour);
        });
        const [from, to] = [-60, 60].map((x) => onPlane(place, WIDTH / 2 + x, bottom));
        sheets.line(from, to, eye, 12, colour);
        hands.forEach(({ ray }, side) => {
            if (!ray) return;
            const at = this.#mets[side];
            const tip = placed(ray, scaled(AHEAD, at?.distance ?? BEAM));
            sheets.line(ray.position, tip, eye, 1.5, [...ACCENT.slice(0, 3), 0.6] as Colour);
            const half = scaled(place.right, 4);
            if (at) sheets.line(sub(tip, half), add(tip, half), eye, 8, WHITE);
        });
    }
}

/** The plane of the panel with its middle at a place: upright, towards a head. */
const upright = (middle: Vec3, { position: [x, , z] }: Pose): Plane =>
    facing([WIDTH / 2, HEIGHT / 2], middle, [x, middle[1], z], POINT);

/**
 * The plane of the panel: before a head, at the left of the patient, whose corners these are, metres. Of a
 * patient who is wider than the eyes see, some may be behind the panel.
 */
export function beside(head: Pose, patient: Vec3[]): Plane {
    const ahead = level(forward(head));
    const left = cross(UP, ahead);
    const edge = patient
        .map((place) => sub(place, head.position))
        .filter((to) => dot(to, ahead) > 0)
        .reduce((most, to) => Math.max(most, Math.atan2(dot(to, left), dot(to, ahead))), -Infinity);
    const wanted = edge + GAP + Math.atan((0.5 * WIDTH * POINT) / BESIDE);
    const towards = turned(yaw(Math.min(Math.max(wanted, ASIDE[0]), ASIDE[1])), ahead);
    return upright(add(head.position, sub(scaled(towards, BESIDE), scaled(UP, BELOW))), head);
}
