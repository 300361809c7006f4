// The page's own parts that need no browser: cameras, the edited curve, addresses, and what is refused.
import assert from 'node:assert/strict';
import test from 'node:test';
import { DAMAGED, decoded } from '../scene.ts';
import { at } from '../transfer/function.ts';
import type { Atlas, Camera, Scene, TransferFunction, Vec3 } from '../types.ts';
import { packed, stateOf, takeState, unpacked } from '../ui/address.ts';
import { App, planesOf } from '../ui/app.ts';
import {
    about,
    axesOf,
    between,
    cameraOf,
    fitted,
    from,
    orbitOf,
    panned,
    projection,
    rolled,
    SIDES,
    turned,
    viewOf,
    zoomed,
} from '../ui/camera.ts';
import { isCamera, isClip, isFunction, isLight, isScene } from '../ui/checks.ts';
import * as curve from '../ui/curve.ts';
import { quantiles } from '../ui/measure.ts';
import { newest } from '../ui/newest.ts';
import { corners, distance } from '../ui/vectors.ts';

// The page's clock is that of a screen.
globalThis.cancelAnimationFrame = () => {};

const CAMERA: Camera = { eye: [120, 500, -180], target: [10, 20, -200], up: [0, 0, 1], fieldOfView: 30 };
const BONE: TransferFunction = {
    name: 'Bone',
    colours: [
        [120, 0.6, 0.2, 0.1],
        [260, 0.8, 0.5, 0.3],
        [1200, 1, 1, 0.9],
    ],
    opacities: [
        [120, 0],
        [400, 0.3],
        [1500, 0.8],
    ],
    gradientOpacities: [],
    material: { shade: true, ambient: 0.2, diffuse: 0.8, specular: 0.2, power: 20, occlusion: 0 },
};

const close = (a: readonly number[], b: readonly number[], by = 1e-9) =>
    assert.ok(a.length === b.length && a.every((x, k) => Math.abs(x - b[k]) < by), `${a} is not ${b}`);

test('a camera and its angles are the same', () => {
    for (const camera of [CAMERA, rolled(CAMERA, 0.7), ...SIDES.map((side) => from(CAMERA, side))]) {
        const back = cameraOf(orbitOf(camera));
        close(back.eye, camera.eye, 1e-6);
        close(axesOf(back).flat(), axesOf(camera).flat(), 1e-6);
    }
});

test('sides are those of the patient', () => {
    const looks: Record<string, Vec3> = {
        anterior: [0, -1, 0],
        posterior: [0, 1, 0],
        left: [1, 0, 0],
        right: [-1, 0, 0],
        superior: [0, 0, -1],
        inferior: [0, 0, 1],
    };
    for (const side of SIDES) close(viewOf(from(CAMERA, side), 1).forward, looks[side]);
    // From the front the patient's right is on the left, and from the head the front is above.
    close(viewOf(from(CAMERA, 'anterior'), 1).right, [-1, 0, 0]);
    close(viewOf(from(CAMERA, 'superior'), 1).up, [0, 1, 0]);
});

test('a turn keeps the distance and stops above the head', () => {
    const camera = turned(CAMERA, 1, 5);
    assert.ok(Math.abs(distance(camera.eye, camera.target) - distance(CAMERA.eye, CAMERA.target)) < 1e-9);
    close(viewOf(camera, 1).forward, [0, 0, -1]);
    // What a drag turns is what the picture shows, however it is rolled: the eye goes to the picture's right.
    for (const roll of [0, 0.5, 2]) {
        const before = rolled(CAMERA, roll);
        const after = turned(before, 1e-4, 0);
        const [right, up] = axesOf(before);
        const way = after.eye.map((x, k) => x - before.eye[k]) as Vec3;
        const along = (axis: Vec3) => axis.reduce((sum, x, k) => sum + x * way[k], 0);
        assert.ok(along(right) > 0.02 && Math.abs(along(up)) < 0.35 * along(right), `${roll}`);
    }
});

test('what is under the cursor stays there', () => {
    const [width, height] = [800, 600];
    const place = (camera: Camera, p: Vec3) => projection(camera, width, height)(p)!;
    // A point at the pivot's depth.
    const [right, up] = axesOf(CAMERA);
    const point = CAMERA.target.map((x, k) => x + 40 * right[k] + 25 * up[k]) as Vec3;
    const [x, y] = place(CAMERA, point);
    close(place(zoomed(CAMERA, 0.5, (x - 400) / 600, (300 - y) / 600), point), [x, y], 1e-6);
    close(place(panned(CAMERA, 0.1, 0.2), point), [x + 60, y - 120], 1e-6);
    close(place(about(CAMERA, point), point), [400, 300], 1e-6);
    assert.equal(projection(CAMERA, 8, 6)(CAMERA.eye), null);
});

test('all of a scene fits, also into a narrow picture', () => {
    const box = corners([-50, -80, -300], [70, 90, -100]);
    for (const [width, height] of [
        [800, 600],
        [390, 844],
    ]) {
        const seen = projection(fitted(CAMERA, box, width / height), width, height);
        for (const p of box) {
            const [x, y] = seen(p)!;
            assert.ok(x > 0 && x < width && y > 0 && y < height, `${x} ${y}`);
        }
    }
    const { tangents } = viewOf(CAMERA, 0.5);
    close(
        tangents,
        [-1, 1, 2, -2].map((n) => n * Math.tan(Math.PI / 12)),
    );
});

test('the way between two cameras takes the short turn', () => {
    const [a, b] = [170, -170].map((degrees) =>
        cameraOf({ ...orbitOf(CAMERA), azimuth: (degrees * Math.PI) / 180, elevation: 0 }),
    );
    close(viewOf(between(a, b, 0.5), 1).forward, [0, 1, 0]);
    close(between(a, b, 1).eye, b.eye, 1e-9);
});

test('joint points are the same function', () => {
    const step: TransferFunction = {
        ...BONE,
        opacities: [
            [120, 0],
            [300, 0.1],
            [300, 0.6],
            [800, 0.6],
        ],
    };
    for (const tf of [BONE, step]) {
        const back = curve.functionOf(curve.pointsOf(tf), tf);
        for (let v = 0.25; v < 1600; v += 7) {
            const [[c, o], [d, p]] = [at(tf, v), at(back, v)];
            close([...c, o], [...d, p]);
        }
    }
    assert.equal(curve.pointsOf(step).filter((p) => p.intensity === 300).length, 2);
});

test('points are added, moved between their neighbours, and told apart', () => {
    const points = curve.pointsOf(BONE);
    const full = curve.fullRange(points, [-1000, 2000]);
    close(full, [-1060, 2060]);
    const index = curve.add(points, BONE, 330, 0.2, full);
    assert.equal(index, 2);
    close(points[index].colour, at(BONE, 330)[0]);
    assert.equal(curve.add(points, BONE, 330.1, 0.2, full), -1);
    curve.move(points, index, 5000, 2, full);
    assert.ok(points[index].intensity < 400 && points[index].intensity > 399 && points[index].opacity === 1);
    assert.equal(curve.beside(points, 0, full), 190);
    close([curve.heightOf(0.09), curve.opacityOf(0.3), curve.opacityOf(-1)], [0.3, 0.09, 0]);
});

test('axes have round numbers', () => {
    assert.deepEqual(curve.ticks([-130, 1530], 5), [0, 500, 1000, 1500]);
    assert.deepEqual(curve.ticks([0, 1], 4), [0, 0.5, 1]);
    assert.deepEqual([0.7, 1, 4.9, 73].map(curve.roundDown), [0.5, 1, 2, 50]);
});

test('text is decoded, and what is no such text is refused', () => {
    assert.deepEqual([...decoded('', 0)], []);
    const letters = Array.from({ length: 94 }, (_, i) => String.fromCharCode(33 + i)).filter(
        (c) => !'"&<'.includes(c),
    );
    // 0x1fff: 8191 = 1 + 91 · 90; then seven bits of 0.
    assert.deepEqual([...decoded(letters[1] + letters[90] + '!!', 2)], [0xff, 0x1f]);
    for (const [text, bytes] of [
        ['!!', 3],
        ['!!!!', 1],
        ['!"', 1],
        ['! ', 1],
    ] as const) {
        assert.throws(() => decoded(text, bytes), { message: DAMAGED });
    }
});

const SCENE: Scene = {
    program: 'vgs 0.3.0',
    title: 'Bones',
    unit: 'hu',
    parts: [],
    objects: [
        { number: 1, name: 'bones', visible: true, tint: null, opacity: 1, function: null },
        {
            number: 4,
            name: 'liver',
            visible: true,
            tint: [0.5, 0.2, 0.2],
            opacity: 0.5,
            function: { ...BONE, name: 'Usual' },
        },
    ],
    function: BONE,
    presets: [
        BONE,
        {
            ...BONE,
            name: 'Steep',
            opacities: [
                [150, 0],
                [300, 0.8],
            ],
        },
    ],
    light: { direction: [-0.4, 0.5, 1], fixedTo: 'camera', fill: 0 },
    clip: [
        { normal: [0, 1, 0], offset: -5 },
        ...planesOf([
            [-50, -60, -70],
            [50, 60, 70],
        ]),
    ],
    camera: CAMERA,
    background: [0, 0, 0],
};

/** The state of a page whose display draws nothing. */
function app(): App {
    const display = {
        setLook: () => {},
        setView: () => {},
        bounds: [
            [-99, -99, -99],
            [99, 99, 99],
        ],
    };
    const atlas = { size: [100, 100, 100], worldFromVoxel: [2, 0, 0, -99, 0, 2, 0, -99, 0, 0, 2, -99] };
    return new App(SCENE, atlas as unknown as Atlas, display as unknown as App['display']);
}

test('planes of a scene are a plane and a box', () => {
    const { plane, box, look } = app();
    assert.deepEqual(plane, SCENE.clip[0]);
    assert.deepEqual(box, [
        [-50, -60, -70],
        [50, 60, 70],
    ]);
    assert.equal(look.clip.length, 7);
});

test('a function that a user takes is for all, but for objects with one that the user chose', () => {
    const page = app();
    page.setFunction(SCENE.presets[1]);
    assert.equal(page.appearance(4).function, null);
    page.setUsual();
    assert.equal(page.appearance(4).function?.name, 'Usual');
    page.setAppearance(4, { function: SCENE.presets[1] });
    page.setFunction({ ...BONE, name: 'Mine' });
    assert.equal(page.appearance(4).function?.name, 'Steep');
});

test('changes are undone, and those of one drag at once', () => {
    const page = app();
    for (const depth of [1, 2, 3]) page.setPlane({ normal: [0, 0, 1], offset: depth });
    page.undo();
    assert.deepEqual([page.plane, page.canUndo, page.canRedo], [SCENE.clip[0], false, true]);
    page.redo();
    assert.equal(page.plane?.offset, 3);
});

test('an address keeps what differs from the file', async () => {
    const page = app();
    assert.equal(stateOf(page), null);
    page.setFunction({ ...SCENE.presets[1], material: { ...BONE.material, occlusion: 0.25 } });
    page.setAppearance(1, { tint: [1, 0.5, 0], visible: false });
    page.setPlane(null);
    page.setCamera(from(CAMERA, 'left'));
    const text = await packed(stateOf(page)!);
    assert.ok(/^1[\w-]+$/.test(text) && text.length < 400, text);
    const other = app();
    assert.ok(takeState(other, await unpacked(text)));
    assert.equal(other.look.function.name, 'Steep');
    assert.equal(other.look.function.material.occlusion, 0.25);
    assert.deepEqual(other.appearance(1), page.appearance(1));
    assert.deepEqual(other.appearance(4).function, null);
    assert.equal(other.look.clip.length, 6);
    close(other.camera.eye, page.camera.eye, 1e-2);
});

test('what is no state changes nothing', async () => {
    for (const bad of ['', '2abc', '1', '1abc', '1*', '1'.padEnd(2e5, 'A')])
        await assert.rejects(unpacked(bad), bad);
    const page = app();
    const { look, camera } = page;
    for (const bad of [
        null,
        7,
        [],
        { camera: { ...CAMERA, eye: CAMERA.target } },
        { camera: { ...CAMERA, fieldOfView: '30' } },
        { function: [9, BONE.material] },
        {
            function: {
                ...BONE,
                opacities: [
                    [5, 0.1],
                    [1, 0.2],
                ],
            },
        },
        { objects: 3 },
        { objects: [[77, { visible: true }]] },
        { objects: [[1, { opacity: 2 }]] },
        { objects: [[1, { other: 1 }]] },
        { objects: [[1, { function: 5 }]] },
        { objects: [[1, { constructor: 1 }]] },
        { function: ['constructor', BONE.material] },
        { camera: { ...CAMERA, up: [110, 480, 20] } },
        { clip: [{ normal: [0, 0, 2], offset: 1 }] },
        { place: [0, 0] },
        { light: { direction: [0, 0, 0], fixedTo: 'camera', fill: 0 } },
        { camera: CAMERA, clip: 'none' },
    ]) {
        assert.equal(takeState(page, bad), false, JSON.stringify(bad));
        assert.deepEqual([page.look, page.camera], [look, camera]);
    }
});

test('what is from outside is checked', () => {
    assert.ok(isCamera(CAMERA) && isFunction(BONE) && isClip(SCENE.clip) && isLight(SCENE.light));
    assert.ok(!isCamera({ ...CAMERA, up: [0, 0, NaN] }) && !isFunction({ ...BONE, colours: [] }));
    assert.ok(!isClip(Array(9).fill(SCENE.clip[0])) && !isFunction({ ...BONE, opacities: [[0, 1.5]] }));
});

test('a place out of the scene is its nearest in it', () => {
    const page = app();
    assert.ok(takeState(page, { place: [5, -1e6, 1e6] }));
    assert.deepEqual(page.place, [5, -99, 99]);
});

test('a scene is checked for what the page needs of it', () => {
    const scene: Scene = { ...SCENE, parts: [{ kind: 'vgs', bytes: 7, numbers: [[0, 1]] }] };
    assert.ok(isScene(scene));
    for (const key of Object.keys(scene)) assert.ok(!isScene({ ...scene, [key]: undefined }), key);
    const changes = [
        { camera: { ...CAMERA, up: [110, 480, 20] } },
        { function: { ...BONE, colours: [[1, 2, null, 3]] } },
        { function: { ...BONE, opacities: [] } },
        { objects: [null] },
        { parts: [] },
        { parts: [{ kind: 'vgs', bytes: '7', numbers: [] }] },
    ];
    for (const change of changes) assert.ok(!isScene({ ...scene, ...change }), JSON.stringify(change));
});

test('of what is wanted meanwhile the newest is found', async () => {
    const asked: number[] = [];
    const told: (number | null)[] = [];
    const answers: ((found: number) => void)[] = [];
    const reader = newest(
        (wanted: number) => {
            asked.push(wanted);
            return new Promise<number | null>((done) => answers.push(done));
        },
        (found) => told.push(found),
    );
    const settled = () => new Promise((done) => setTimeout(done));
    for (const wanted of [1, 2, 3]) reader.want(wanted);
    answers[0](10);
    await settled();
    assert.deepEqual([asked, told], [[1, 3], [10]]);
    reader.forget();
    answers[1](30);
    await settled();
    assert.deepEqual([asked, told], [[1, 3], [10]]);
    reader.want(4);
    answers[2](40);
    await settled();
    assert.deepEqual(told, [10, 40]);
});

test('quantiles of times', () => {
    assert.deepEqual(quantiles([]), { frames: 0, p50: 0, p95: 0, max: 0 });
    const times = Array.from({ length: 100 }, (_, i) => 100 - i);
    assert.deepEqual(quantiles(times), { frames: 100, p50: 51, p95: 96, max: 100 });
});
