// What hands do to the scene: one carries it, two stretch and turn it, the thumbstick moves the window,
// buttons change presets, hold a cutting plane and put everything back (as xr-app/src/controls.rs).
import type { App } from '../ui/app.ts';
import type { Plane, TransferFunction, Vec3 } from '../types.ts';
import { dot } from '../render/vectors.ts';
import { extent } from '../transfer/function.ts';
import { Button, GRAB, type Hand, type Hands, HOLDS, idle, pulse, SNAP } from './hands.ts';
import {
    before, carried, patientDirection, patientOf, type Placement, stretched, stretchedScale,
} from './placement.ts';
import { ORIGIN, type Pose, turned } from './pose.ts';

/** Largest deflection of a thumbstick that counts as rest. */
const RESTS = 0.15;
/** Part of the range of intensities by which a thumbstick at its end moves level or width in a second. */
const PER_SECOND = 0.25;
/** Narrowest window, as a part of that of the preset. */
const NARROWEST = 0.05;
/** Seconds that the left second button is held until it resets, and until that is said. */
const RESETS = 1, SOON = 0.4;
/** Distance from real size within which a patient between two hands has real size. */
const SNAPS = 0.04;

export class Controls {
    readonly app: App;
    placement: Placement;
    /** A few words for the viewer, until somebody takes them. */
    notice = '';
    /** The plane in the right hand, and where the hand is, mm RAS. */
    cut: { plane: Plane; at: Vec3 } | null = null;
    #hands: Hands = [idle(), idle()];
    #home: Placement;
    #cutting = false;
    /** Pose, in the frame before, of each hand that holds. */
    #held: [Pose | null, Pose | null] = [null, null];
    /** Magnification between two hands, as if nothing snapped. */
    #stretched: number | null = null;
    #next = [new Button(), new Button()];
    #other = new Button();
    #heldFor: number | null = null;
    /** The function before its window was moved. */
    #base: TransferFunction;

    constructor(app: App) {
        this.app = app;
        this.#home = this.placement = before(ORIGIN, ORIGIN.position, 0);
        this.#base = app.look.function;
    }

    /** Places the patient; a reset puts it back there. */
    place(placement: Placement): void {
        this.#home = this.placement = placement;
        this.#held = [null, null];
    }

    holds(side: number): boolean {
        return this.#held[side] !== null;
    }

    /** Does what the hands do in a frame that lasts `seconds`. */
    act(hands: Hands, seconds: number): void {
        this.#hands = hands;
        this.#carry(hands);
        hands.forEach((hand, side) => {
            if (this.#next[side].pressed(hand.next)) this.#step(side ? 1 : -1);
        });
        this.#leftButton(hands[0], seconds);
        if (this.#other.pressed(hands[1].other)) this.takePlane();
        const { grip } = hands[1];
        if (this.#cutting && grip) {
            this.cut = { plane: this.#planeAcross(grip), at: patientOf(this.placement, grip.position) };
        }
        this.#moveWindow(hands[1].stick, seconds);
    }

    #carry(hands: Hands): void {
        const before = this.#held;
        this.#held = hands.map((hand, side) => {
            const holds = hand.grip && hand.squeeze >= (before[side] ? HOLDS / 2 : HOLDS);
            if (holds && !before[side]) pulse(hand, GRAB);
            return holds ? hand.grip : null;
        }) as [Pose | null, Pose | null];
        const [[a, b], [c, d]] = [before, this.#held];
        if (a && b && c && d) {
            this.#stretch([a.position, b.position], [c.position, d.position], hands);
            return;
        }
        this.#stretched = null;
        // A hand that has just taken hold, or let go, moves nothing.
        const [from, to] = a && c ? [a, c] : [b, d];
        if (from && to && !(a && b) && !(c && d)) this.placement = carried(this.placement, from, to);
    }

    /** Stretches the patient between two hands; near real size it snaps to that. */
    #stretch(from: [Vec3, Vec3], to: [Vec3, Vec3], hands: Hands): void {
        const before = this.placement.scale;
        this.#stretched = stretchedScale(this.#stretched ?? before, from, to);
        const scale = Math.abs(this.#stretched - 1) <= SNAPS ? 1 : this.#stretched;
        if (scale === 1 && before !== 1) {
            hands.forEach((hand) => pulse(hand, SNAP));
            this.notice = 'Real size';
        }
        this.placement = stretched(this.placement, from, to, scale);
    }

    #leftButton(hand: Hand, seconds: number): void {
        const before = this.#heldFor;
        this.#heldFor = hand.other ? (before === null ? 0 : before + seconds) : null;
        if (before === null || this.#heldFor === null) return;
        if (before < RESETS && this.#heldFor >= RESETS) {
            pulse(hand, SNAP);
            this.reset();
        } else if (before < SOON && this.#heldFor >= SOON) {
            this.notice = 'Keep holding to reset';
        }
    }

    /** Takes a plane into the right hand, leaves it where it is, and takes it away, in turn. */
    takePlane(): void {
        const { app } = this;
        if (this.#cutting) {
            this.#cutting = false;
            if (this.cut) app.setPlane(this.cut.plane);
            this.cut = null;
            this.notice = 'Cutting plane fixed';
        } else if (app.plane) {
            app.setPlane(null);
            this.notice = 'Cutting plane off';
        } else {
            this.#cutting = true;
            this.notice = 'Cutting plane in the right hand';
        }
        pulse(this.#hands[1], GRAB);
    }

    /**
     * A plane across a hand, like a blade in it: what is to the left of it, as the hand sees it, is cut away.
     */
    #planeAcross(grip: Pose): Plane {
        const normal = patientDirection(this.placement, turned(grip.orientation, [1, 0, 0]));
        return { normal, offset: dot(normal, patientOf(this.placement, grip.position)) };
    }

    /** True while there is a cutting plane, in the hand or not. */
    get cuts(): boolean {
        return this.#cutting || this.app.plane !== null;
    }

    realSize(): void {
        this.placement = { ...this.placement, scale: 1 };
        this.notice = 'Real size';
    }

    /** Puts everything back as it was at the start. */
    reset(): void {
        this.placement = this.#home;
        this.#cutting = false;
        this.cut = null;
        this.app.reset();
        this.#base = this.app.look.function;
        this.notice = 'Everything is put back';
    }

    choose(preset: TransferFunction): void {
        this.app.setFunction(preset);
        this.#base = preset;
        this.notice = preset.name;
    }

    /** Takes the next preset, or the one before. */
    #step(by: number): void {
        const { presets } = this.app.scene;
        if (!presets.length) return;
        const now = presets.findIndex(({ name }) => name === this.app.look.function.name);
        // From a function that is none of them: to the first or the last.
        const from = now < 0 && by < 0 ? 0 : now;
        this.choose(presets[(from + by + presets.length) % presets.length]);
    }

    /** Sets the middle and the width of the window. */
    setWindow(level: number, width: number): void {
        const [low, high] = extent(this.#base);
        const half = 0.5 * Math.max(width, NARROWEST * (high - low));
        this.app.setWindow(level - half, level + half);
    }

    #moveWindow(stick: [number, number], seconds: number): void {
        const [x, y] = stick.map((v) => (Math.sign(v) * Math.max(Math.abs(v) - RESTS, 0)) / (1 - RESTS));
        if (x === 0 && y === 0) return;
        const [low, high] = extent(this.app.look.function);
        const [least, greatest] = this.app.atlas.range;
        this.setWindow(
            (low + high) / 2 + y * PER_SECOND * seconds * (greatest - least),
            (high - low) * Math.exp(4 * x * PER_SECOND * seconds),
        );
    }
}
