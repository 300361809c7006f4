// The plane and the box that cut.
import { dot, scaled } from '../render/vectors.ts';
import type { Plane, Vec3 } from '../types.ts';
import type { App, Box } from './app.ts';
import { axesOf } from './camera.ts';
import { button, checkbox, element, slider } from './elements.ts';
import { coordinate } from './overlay.ts';

/** Where the plane cuts from, and its normal, towards what is kept. */
const SIDES: [string, Vec3][] = [
    ['From the front', [0, -1, 0]],
    ['From the back', [0, 1, 0]],
    ['From the right', [-1, 0, 0]],
    ['From the left', [1, 0, 0]],
    ['From the head', [0, 0, -1]],
    ['From the feet', [0, 0, 1]],
];
/** Names of the ends of the axes of RAS. */
const ENDS = [
    ['Left', 'Right'],
    ['Back', 'Front'],
    ['Feet', 'Head'],
];

/** A plane through the middle of what there is to see. */
export function through(app: App, normal: Vec3): Plane {
    const [low, high] = offsets(app, normal);
    return { normal, offset: (low + high) / 2 };
}

/** The least and the greatest offset at which a plane cuts something. */
function offsets(app: App, normal: Vec3): [number, number] {
    const places = app.corners.map((corner) => dot(corner, normal));
    return [Math.min(...places), Math.max(...places)];
}

/** A plane that faces the viewer and cuts away the nearer half. */
export const facing = (app: App): Plane => through(app, scaled(axesOf(app.camera)[2], -1));

const flipped = ({ normal, offset }: Plane): Plane => ({ normal: scaled(normal, -1), offset: -offset });

export function cuttingPanel(app: App, into: HTMLElement): void {
    planePart(app, into);
    boxPart(app, into);
}

function planePart(app: App, into: HTMLElement): void {
    const on = checkbox('Plane', (wanted) => app.setPlane(wanted ? through(app, SIDES[0][1]) : null));
    const side = element(
        'select',
        { 'aria-label': 'What the plane cuts away' },
        ...SIDES.map(([name], i) => element('option', { value: i }, name)),
        element('option', { value: -1, hidden: true }, 'Free'),
    );
    side.addEventListener('change', () => app.setPlane(through(app, SIDES[Number(side.value)][1])));
    // From 0, which cuts nothing away, to all that there is.
    const depth = slider('Depth', 'mm', (value) => {
        if (app.plane) app.setPlane({ ...app.plane, offset: offsets(app, app.plane.normal)[0] + value });
    });
    const flip = button('Flip', () => app.plane && app.setPlane(flipped(app.plane)), {
        title: 'Keep the other side',
    });
    const face = button('Face me', () => app.setPlane(facing(app)), { title: 'Across the view' });
    const where = element('p', { class: 'dim' });
    const controls = element('div', {}, element('div', { class: 'row' }, side, flip, face), depth.row, where);
    into.append(element('div', {}, on.row), controls);
    const show = () => {
        const { plane } = app;
        on.box.checked = !!plane;
        controls.hidden = !plane;
        if (!plane) return;
        const [low, high] = offsets(app, plane.normal);
        side.value = `${SIDES.findIndex(([, normal]) => dot(normal, plane.normal) > 1 - 1e-9)}`;
        depth.setRange(0, Math.ceil((high - low) * 2) / 2, 0.5);
        depth.set(plane.offset - low);
        const axis = plane.normal.findIndex((n) => Math.abs(n) > 1 - 1e-9);
        where.hidden = axis < 0;
        if (axis >= 0) where.textContent = `At ${coordinate(plane.offset * plane.normal[axis], axis)} mm`;
    };
    app.on('look', show);
    show();
}

function boxPart(app: App, into: HTMLElement): void {
    const on = checkbox('Box', (wanted) => app.setBox(wanted ? app.extent : null));
    const set = (axis: number, end: number, value: number) => {
        if (!app.box) return;
        const box = app.box.map((corner) => [...corner]) as Box;
        box[end][axis] = end ? Math.max(value, box[0][axis] + 1) : Math.min(value, box[1][axis] - 1);
        app.setBox(box);
    };
    const sliders = ENDS.flatMap((names, axis) =>
        names.map((name, end) => {
            const made = slider(name, 'mm', (value) => set(axis, end, value));
            made.setRange(Math.floor(app.extent[0][axis]), Math.ceil(app.extent[1][axis]), 0.5);
            return { made, axis, end };
        }),
    );
    const controls = element('div', {}, ...sliders.map(({ made }) => made.row));
    into.append(element('div', {}, on.row), controls);
    const show = () => {
        on.box.checked = !!app.box;
        controls.hidden = !app.box;
        if (app.box) for (const { made, axis, end } of sliders) made.set(app.box[end][axis]);
    };
    app.on('look', show);
    show();
}
