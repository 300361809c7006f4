// A session in a headset, from its first frame to its end.
import levels from 'quality-levels';
import { PLANES } from '../render/look.ts';
import { add, length, scaled, sub } from '../render/vectors.ts';
import type { Look, Quality, Vec3 } from '../types.ts';
import type { App } from '../ui/app.ts';
import { Budget, LATE } from './budget.ts';
import { Controls } from './controls.ts';
import { type Hands, handsOf, HOLDS, idle } from './hands.ts';
import { ArrayLayer, FlatLayer, type Layer } from './layers.ts';
import { outline } from './outline.ts';
import { BAND, HEIGHT, Panel, WIDTH } from './panel.ts';
import { before, roomOf, viewOf } from './placement.ts';
import { ACCENT, Pointing } from './pointing.ts';
import { forward, level, type Pose, placed, poseOf } from './pose.ts';
import { type Colour, label, Sheets } from './sheets.ts';

/** Frames a second that are asked for, and assumed where the headset does not say. */
const RATE = 72;
/** Longer steps of samples than this, voxels, miss thin anatomy. */
const LONGEST = 0.5;
/** The levels of quality: pixels and steps, never what is shown. */
const LADDER = levels.filter(({ coarseness }) => coarseness <= LONGEST);
/** The level to begin with: one that small headsets hold, so that none begins with late frames. */
const FIRST = LADDER.length - 2;
/** Least time from one painting of the panel to the next, and from one new look to the next, seconds. */
const PAINTED = 0.1, TAKEN = 0.05;
/** Place of words before a head, metres ahead and below the eyes, and how long they stay, seconds. */
const AHEAD = 0.6, BELOW = 0.13, STAYS = 2;
const REST: Colour = [0.69, 0.71, 0.73, 1], TIP: Colour = [0.94, 0.78, 0.35, 1];

const qualityOf = ({ coarseness: step }: (typeof LADDER)[number]): Quality =>
    ({ step, cell: null, occlusion: false });

/** What a session was like. */
export interface Report {
    mode: string;
    /** Frames a second of the display. */
    rate: number;
    /** Frames that were drawn at each level of quality, from the best one. */
    levels: number[];
    /** How many of them came late. */
    late: number;
    /** Pixels of an eye at the best level. */
    width: number;
    height: number;
    /** True if both eyes were drawn in one pass. */
    multiview: boolean;
}

export class Visit {
    readonly session: XRSession;
    readonly report: Report;
    readonly controls: Controls;
    readonly panel: Panel;
    readonly pointing: Pointing;
    readonly budget = new Budget(LADDER.map(({ cost }) => cost), FIRST);
    readonly space: XRReferenceSpace;
    /** The hands in the last frame. */
    hands: Hands = [idle(), idle()];
    readonly #app: App;
    readonly #layer: Layer;
    readonly #sheets: Sheets;
    readonly #selecting = new Set<XRInputSource>();
    /** False until the patient has been placed before the head. */
    #isPlaced = false;
    /** Time of the frame before, ms. */
    #last = 0;
    /** What the renderer shows: the look, and whether it is a draft of it. */
    #shown: { look: Look; draft: boolean } | null = null;
    /** When it took that, and when the panel was painted, seconds. */
    #taken = 0;
    #painted = 0;
    #notice: { until: number; at: Vec3 } | null = null;

    /** Takes over a session that has just begun. */
    static async begin(app: App, session: XRSession, mode: XRSessionMode): Promise<Visit> {
        app.display.suspend();
        try {
            await app.display.gl.makeXRCompatible();
            const { frameRate, supportedFrameRates } = session;
            if (frameRate !== RATE && supportedFrameRates?.includes(RATE)) {
                // A headset that keeps its own rate is as good.
                await session.updateTargetFrameRate(RATE).catch(() => {});
            }
            const { renderer } = app.display;
            const multiview = ArrayLayer.offered(session, renderer);
            renderer.setLook(app.look);
            await renderer.prepare(qualityOf(LADDER[0]), multiview);
            return new Visit(app, session, await session.requestReferenceSpace('local'), mode, multiview);
        } catch (error) {
            await session.end().catch(() => {});
            app.display.resume();
            throw error;
        }
    }

    private constructor(
        app: App, session: XRSession, space: XRReferenceSpace, mode: XRSessionMode, multiview: boolean,
    ) {
        this.#app = app;
        this.session = session;
        this.space = space;
        const { gl, renderer, canvas } = app.display;
        this.#layer = multiview ? new ArrayLayer(gl, session) : new FlatLayer(gl, session);
        const levels = LADDER.map(() => 0);
        this.report = { mode, rate: RATE, levels, late: 0, width: 0, height: 0, multiview };
        this.controls = new Controls(app);
        this.panel = new Panel(app, this.controls, this.#leave);
        this.pointing = new Pointing(this.panel, this.controls);
        this.#sheets = new Sheets(gl, this.panel.canvas, this.#layer.multiview);
        renderer.opaque = session.environmentBlendMode === 'opaque';
        const selecting = this.#selecting;
        session.addEventListener('selectstart', ({ inputSource }) => selecting.add(inputSource));
        session.addEventListener('selectend', ({ inputSource }) => selecting.delete(inputSource));
        session.addEventListener('inputsourceschange', ({ removed }) =>
            removed.forEach((source) => selecting.delete(source)));
        session.addEventListener('end', () => this.#end());
        canvas.addEventListener('webglcontextlost', this.#leave);
        // Whoever turns the room wants the patient before them again.
        space.addEventListener('reset', () => (this.#isPlaced = false));
        session.requestAnimationFrame(this.#frame);
    }

    /** Ends it after the frame in which that was asked for, if it has not ended already. */
    #leave = (): void => queueMicrotask(() => {
        this.session.end().catch(() => {});
    });

    #end(): void {
        const { display } = this.#app;
        display.canvas.removeEventListener('webglcontextlost', this.#leave);
        // A plane that was in the hand stays.
        if (this.controls.cut) this.controls.takePlane();
        this.#layer.dispose();
        this.#sheets.dispose();
        display.renderer.opaque = true;
        display.resume();
    }

    #frame = (time: number, frame: XRFrame): void => {
        const { session } = this;
        session.requestAnimationFrame(this.#frame);
        const viewer = frame.getViewerPose(this.space);
        if (!viewer) return;
        const head = poseOf(viewer.transform);
        if (!this.#isPlaced) this.#place(head);
        const ms = this.#last ? time - this.#last : 0;
        this.#last = time;
        const isVisible = session.visibilityState === 'visible';
        if (isVisible && ms > 0) this.#count(ms);
        this.hands = isVisible ? handsOf(frame, this.space, this.#selecting) : [idle(), idle()];
        // After a pause nothing is to jump.
        const seconds = Math.min(ms, 100) / 1000;
        this.controls.act(this.pointing.point(this.hands, head, time / 1000, seconds), seconds);
        this.#takeLook(time / 1000);
        this.#draw(viewer.views, head, time / 1000);
    };

    /** Takes the time since the frame before, ms. */
    #count(ms: number): void {
        const { report, budget } = this;
        report.rate = this.session.frameRate ?? RATE;
        report.levels[budget.level]++;
        if (ms > (LATE * 1000) / report.rate) report.late++;
        budget.frame(ms, 1000 / report.rate);
    }

    #place(head: Pose): void {
        // A panel that was put away stays there.
        const shows = !this.#last || this.pointing.place;
        const [low, high] = this.#app.extent;
        this.controls.place(before(head, scaled(add(low, high), 0.5), 0.5 * length(sub(high, low))));
        this.#isPlaced = true;
        this.pointing.place = null;
        if (shows) this.pointing.toggle(head);
    }

    /** Gives the renderer the look, with the plane in the hand. */
    #takeLook(seconds: number): void {
        const { look } = this.#app, { cut } = this.controls;
        // Gradients of what is being dragged would take too long.
        const draft = this.panel.isPressed;
        const shown = this.#shown;
        const isShown = shown?.look === look && (draft || !shown.draft);
        if (!cut && (isShown || (shown && seconds - this.#taken < TAKEN))) return;
        this.#taken = seconds;
        const clip = cut ? [...look.clip.slice(0, PLANES - 1), cut.plane] : look.clip;
        this.#app.display.renderer.setLook({ ...look, clip }, draft);
        this.#shown = cut ? null : { look, draft };
    }

    #draw(all: readonly XRView[], head: Pose, seconds: number): void {
        const layer = this.#layer, { placement } = this.controls;
        const found = layer.ports(all);
        const seen = all.flatMap((view, i) => (found[i] ? [{ view, port: found[i] }] : []));
        if (!seen.length) return;
        const ports = seen.map(({ port }) => port);
        const quality = LADDER[this.budget.level];
        Object.assign(this.report, { width: ports[0].width, height: ports[0].height });
        const views = seen.map(({ view }) => viewOf(placement, view));
        layer.draw(this.#app.display.renderer, views, ports, quality.resolution, qualityOf(quality));
        this.#layOut(head, seconds);
        const eyes = seen.map(({ view: { transform, projectionMatrix } }) =>
            ({ view: transform.inverse.matrix, projection: projectionMatrix }));
        this.#sheets.draw(eyes, layer.calls(ports));
        const { gl } = this.#app.display;
        gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    }

    /** Lists what is drawn over the picture. */
    #layOut(head: Pose, seconds: number): void {
        const { panel, pointing, controls, hands } = this, sheets = this.#sheets, eye = head.position;
        const { level: at } = this.budget, { resolution, coarseness } = LADDER[at];
        const steps = coarseness / LADDER[0].coarseness;
        panel.quality = at ? `Draft: edges × ${resolution}, steps × ${steps}` : '';
        if (controls.notice) {
            const ahead = scaled(level(forward(head)), AHEAD);
            this.#notice = { until: seconds + STAYS, at: sub(add(eye, ahead), [0, BELOW, 0]) };
            panel.words = controls.notice;
            controls.notice = '';
        }
        if (this.#notice && this.#notice.until < seconds) this.#notice = null;
        const isDue = (pointing.place || this.#notice) && seconds - this.#painted >= PAINTED;
        if (isDue && panel.draw(pointing.pointer)) {
            this.#painted = seconds;
            sheets.refresh();
        }
        hands.forEach((hand) => this.#body(hand, eye));
        const { plane } = this.#app, [low, high] = this.#app.extent;
        const planes = [controls.cut, plane && { plane, at: scaled(add(low, high), 0.5) }];
        for (const cut of planes) {
            const round = cut ? outline(cut.plane, [low, high], cut.at) : [];
            const corners = round.map((mm) => roomOf(controls.placement, mm));
            corners.forEach((from, i) =>
                sheets.line(from, corners[(i + 1) % corners.length], eye, 2.6, ACCENT));
        }
        pointing.show(sheets, hands, eye);
        if (this.#notice) {
            const plane = label([WIDTH / 2, HEIGHT + BAND / 2], this.#notice.at, eye);
            sheets.rectangle(plane, [0, HEIGHT, WIDTH, BAND - 2]);
        }
    }

    /** A hand, so that a viewer sees where it is and what it does: a controller, or its fingers. */
    #body({ grip, ray, fingers, squeeze, select, source }: Hands[0], eye: Vec3): void {
        if (!grip || source?.targetRayMode !== 'tracked-pointer') return;
        const colour: Colour = squeeze >= HOLDS ? ACCENT : REST;
        const lines = (joints: Vec3[], tone: Colour, width: number) => joints.slice(1).forEach((joint, i) =>
            this.#sheets.line(joints[i], joint, eye, width, tone));
        fingers.forEach((joints, i) => lines(joints, i < 2 && select ? TIP : colour, 9));
        if (fingers.length) return;
        const [end, head] = [0.045, -0.042].map((z) => placed(grip, [0, 0, z]));
        const nose = placed({ position: head, orientation: (ray ?? grip).orientation }, [0, 0, -0.042]);
        lines([end, head], colour, 22);
        lines([head, nose], select ? TIP : REST, 10);
    }
}
