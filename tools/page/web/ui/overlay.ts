// What is drawn over the picture: the cube and letters of orientation, the scale, the distance, the place,
// plane and box.
import { dot, scaled } from '../render/vectors.ts';
import type { Pick, Vec3 } from '../types.ts';
import type { App } from './app.ts';
import { axesOf, from, heightOf, projection, type Side } from './camera.ts';
import { roundDown } from './curve.ts';
import { byId, drawn, oncePerFrame } from './elements.ts';
import { along, corners } from './vectors.ts';

/** Faces of the cube. */
const FACES: [Side, string, Vec3][] = [
    ['right', 'R', [1, 0, 0]],
    ['left', 'L', [-1, 0, 0]],
    ['anterior', 'A', [0, 1, 0]],
    ['posterior', 'P', [0, -1, 0]],
    ['superior', 'H', [0, 0, 1]],
    ['inferior', 'F', [0, 0, -1]],
];
/** Half the edge of the cube, and its distance from the corner of the picture, CSS pixels. */
const [HALF, AWAY] = [19, 46];
/** Cosine between a face and the view below which it is seen from its edge. */
const EDGE = 0.02;
/** Share of the picture's width that the scale may take. */
const SCALE = 0.22;
/** Most letters of a name in a line. */
const LONGEST = 40;

/** A value with the unit of the scene. */
export const valued = (app: App, value: number): string =>
    app.scene.unit === 'hu'
        ? `${value.toFixed(0).replace('-', '−')} HU`
        : Number(value.toPrecision(4)).toString().replace('-', '−');

/** A coordinate along an axis of RAS, mm, by the end of the body to which it goes. */
export const coordinate = (mm: number, axis: number): string =>
    `${['RL', 'AP', 'HF'][axis][mm < 0 ? 1 : 0]} ${Math.abs(mm).toFixed(1)}`;

/** A place in the patient's own terms. */
export const placed = (place: Vec3): string => `${place.map(coordinate).join('  ')} mm`;

/** A name of the file within a line: short enough, and isolated from the direction of the line. */
function inLine(name: string): string {
    const letters = [...name.replace(/[\s_]+/g, ' ')];
    const short = letters.length > LONGEST ? [...letters.slice(0, LONGEST - 1), '…'] : letters;
    return `\u2068${short.join('')}\u2069`;
}

/** What has been read at a place, in words. */
export function told(app: App, { value, place, object }: Pick): string {
    const { objects } = app.scene;
    const name = objects.length > 1 ? objects.find((o) => o.number === object)?.name : undefined;
    return [valued(app, value), ...(name ? [inLine(name)] : []), placed(place)].join('  ·  ');
}

export function overlay(app: App): void {
    const svg = byId<SVGSVGElement>('over');
    const draw = () => {
        const { clientWidth: width, clientHeight: height } = app.display.canvas;
        const seen = projection(app.camera, width, height);
        svg.replaceChildren(
            ...cut(app, seen),
            ...distanceLine(app, seen),
            ...crosshair(app, seen),
            ...scale(app, width, height),
            ...letters(app, width, height),
            ...cube(app, width, height),
        );
    };
    const ask = oncePerFrame(draw);
    for (const change of ['look', 'distance', 'place', 'reading', 'panels'] as const) app.on(change, ask);
    // Not before the picture of the camera is there: what is drawn over it fits it, and nothing is drawn in vain.
    app.display.onview = draw;
    new ResizeObserver(ask).observe(app.display.canvas);
    ask();
}

type Seen = (p: Vec3) => [number, number] | null;

function text(content: string, x: number, y: number, className: string): SVGElement {
    return drawn('text', { x, y, class: className }, content);
}

function line(a: [number, number], b: [number, number], className: string): SVGElement {
    return drawn('line', { x1: a[0], y1: a[1], x2: b[0], y2: b[1], class: className });
}

function cube(app: App, width: number, height: number): SVGElement[] {
    const [right, up, back] = axesOf(app.camera);
    const at = (p: Vec3) => [width - AWAY + HALF * dot(p, right), height - AWAY - HALF * dot(p, up)];
    return FACES.filter(([, , normal]) => dot(normal, back) > EDGE).map(([side, letter, normal]) => {
        const [u, v]: Vec3[] = [
            [normal[1], normal[2], normal[0]],
            [normal[2], normal[0], normal[1]],
        ];
        const edge = [
            [1, 1],
            [-1, 1],
            [-1, -1],
            [1, -1],
        ].map(([a, b]) => at(along(along(normal, u, a), v, b)));
        const [x, y] = at(normal);
        const facing = dot(normal, back);
        const face = drawn(
            'g',
            { class: 'face' },
            drawn('title', {}, `View from ${side}`),
            drawn('polygon', {
                points: edge.map((p) => p.join()).join(' '),
                'fill-opacity': 0.35 + 0.4 * facing,
            }),
            ...(facing > 0.25 ? [text(letter, x, y + 4.5, 'letter')] : []),
        );
        face.addEventListener('click', () => app.turnTo(from(app.camera, side)));
        return face;
    });
}

/** Letters at the edges: what lies there. */
function letters(app: App, width: number, height: number): SVGElement[] {
    const [right, up] = axesOf(app.camera);
    const name = (direction: Vec3) =>
        FACES.map(([, letter, axis]) => ({ letter, share: dot(axis, direction) }))
            .filter(({ share }) => share > 0.4)
            .sort((a, b) => b.share - a.share)
            .map(({ letter }) => letter)
            .join('');
    // Beside the bar of tools, where it reaches so far down.
    const tools = byId('tools');
    const left =
        tools.offsetTop + tools.offsetHeight > height / 2 - 10 ? tools.offsetLeft + tools.offsetWidth : 0;
    return [
        text(name(scaled(right, -1)), left + 14, height / 2, 'edge'),
        text(name(right), width - 14, height / 2, 'edge'),
        text(name(up), width / 2, 20, 'edge'),
        text(name(scaled(up, -1)), width / 2, height - 10, 'edge'),
    ];
}

function scale(app: App, width: number, height: number): SVGElement[] {
    const perMm = Math.min(width, height) / heightOf(app.camera);
    const length = roundDown((width * SCALE) / perMm);
    const [x, y, w] = [14, height - 14, length * perMm];
    return [
        drawn('path', { d: `M${x} ${y - 5}v5h${w}v-5`, class: 'scale' }),
        text(`${Number(length.toPrecision(1))} mm`, x + w / 2, y - 6, 'length'),
    ];
}

function distanceLine(app: App, seen: Seen): SVGElement[] {
    const ends = app.ends.map(seen);
    const drawnEnds = ends.flatMap((p) =>
        p ? [drawn('circle', { cx: p[0], cy: p[1], r: 4, class: 'end' })] : [],
    );
    const [a, b] = ends;
    if (!a || !b || app.length === null) return drawnEnds;
    const [x, y] = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2 - 8];
    return [line(a, b, 'distance'), ...drawnEnds, text(`${app.length.toFixed(1)} mm`, x, y, 'length strong')];
}

function crosshair(app: App, seen: Seen): SVGElement[] {
    const place = app.marked ? app.reading?.place : app.slices ? app.place : undefined;
    const at = place && seen(place);
    if (!at) return [];
    const [x, y] = at;
    return [
        drawn('path', {
            d: `M${x - 9} ${y}h6M${x + 3} ${y}h6M${x} ${y - 9}v6M${x} ${y + 3}v6`,
            class: 'cross',
        }),
    ];
}

/** Edges of the box, and the outline of the plane in the box of the scene. */
function cut(app: App, seen: Seen): SVGElement[] {
    const edges = (all: Vec3[]) =>
        all.flatMap((p, i) => [1, 2, 4].filter((bit) => !(i & bit)).map((bit) => [p, all[i | bit]]));
    const lines: [Vec3, Vec3][] = app.box ? (edges(corners(...app.box)) as [Vec3, Vec3][]) : [];
    const drawnLines = lines.flatMap(([p, q]) => {
        const [a, b] = [seen(p), seen(q)];
        return a && b ? [line(a, b, 'box')] : [];
    });
    if (!app.plane) return drawnLines;
    const { normal, offset } = app.plane;
    const points = edges(app.corners).flatMap(([p, q]) => {
        const [a, b] = [dot(p, normal) - offset, dot(q, normal) - offset];
        return a * b < 0 ? [along(p, along(q, p, -1), a / (a - b))] : [];
    });
    if (points.length < 3) return drawnLines;
    const places = points.map(seen).filter((p) => p !== null);
    const middle = [0, 1].map((k) => places.reduce((total, p) => total + p[k], 0) / places.length);
    // The section is convex: its corners by their angle about the middle.
    places.sort(
        (p, q) =>
            Math.atan2(p[1] - middle[1], p[0] - middle[0]) - Math.atan2(q[1] - middle[1], q[0] - middle[0]),
    );
    return [
        ...drawnLines,
        drawn('polygon', { points: places.map((p) => p.join()).join(' '), class: 'plane' }),
    ];
}
