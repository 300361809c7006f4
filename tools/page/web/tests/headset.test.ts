// The page in a headset, emulated by iwer as a Quest 3.
import assert from 'node:assert/strict';
import { after, afterEach, before, describe, it } from 'node:test';
import type { Browser, Page } from 'playwright-core';
import { PNG } from 'pngjs';
import { Budget } from '../headset/budget.ts';
import { harness, launch, missing, open } from './browser.ts';
import type { Api } from './wearing.ts';

declare const api: Api;

/** What iwer and the driver say by themselves. */
const USUAL = /^(log: Nominal frame rate|warning: \[\.WebGL)/;
const near = (a: readonly number[], b: readonly number[], by = 1e-6) =>
    assert.ok(a.every((v, i) => Math.abs(v - b[i]) <= by), `${a} is not ${b}`);

describe('in a headset', { skip: missing }, () => {
    let browser: Browser, page: Page, trouble: string[], close: () => Promise<void>;
    const runs = <T>(f: () => T | Promise<T>) => page.evaluate(f);

    before(async () => {
        browser = await launch();
        const size = { width: 640, height: 360 };
        ({ page, trouble, close } = await open(browser, await harness('wearing.ts'), size));
        await runs(async () => {
            api.install();
            api.start();
            await api.offer();
        });
    });
    after(async () => {
        await close?.();
        await browser?.close();
    });
    afterEach(async () => {
        await runs(() => api.end());
        assert.equal(await runs(() => api.gl.getError()), 0);
        assert.deepEqual(trouble.filter((message) => !USUAL.test(message)), []);
    });

    it('says why there is none', async () => {
        const titles = await runs(async () => {
            const told: [string, boolean][] = [];
            const { xr } = navigator;
            const ask = async (secure: boolean, xr: unknown) => {
                Object.defineProperty(window, 'isSecureContext', { value: secure, configurable: true });
                Object.defineProperty(navigator, 'xr', { value: xr, configurable: true });
                const button = document.createElement('button');
                document.body.append(button);
                await api.offer(button);
                told.push([button.title, button.disabled]);
                button.nextSibling!.remove();
                button.remove();
            };
            await ask(false, undefined);
            await ask(true, undefined);
            await ask(true, Object.assign(new EventTarget(), { isSessionSupported: async () => false }));
            Object.defineProperty(navigator, 'xr', { value: xr, configurable: true });
            return told;
        });
        assert.match(titles[0][0], /https.*vgs page --serve/);
        assert.match(titles[1][0], /Open this page in the browser of a headset/);
        assert.match(titles[2][0], /No headset was found/);
        assert.ok(titles.every(([, disabled]) => disabled));
    });

    it('begins and ends by the button, and the page goes on', async () => {
        const titles = await runs(() => [...document.querySelectorAll('button')].map((one) =>
            [one.textContent, one.title, one.disabled, one.hidden]));
        assert.deepEqual(titles, [
            ['Headset', 'View in the headset', false, false], ['Room', 'View in the room', false, false],
        ]);
        await page.waitForFunction(() => api.finished());
        await page.click('#headset');
        await page.waitForFunction(() => api.device.activeSession);
        const drawn = await runs(async () => {
            await api.frames(4);
            const before = api.app.display.stats.frames.length;
            api.app.setFunction(api.scene.presets[1]);
            await api.frames(4);
            return api.app.display.stats.frames.length - before;
        });
        assert.equal(drawn, 0, 'the page draws nothing meanwhile');
        await runs(() => {
            api.progress = 0;
            api.button.click();
        });
        await page.waitForFunction(() => !api.device.activeSession);
        await page.waitForFunction(() => api.finished());
        const { data } = PNG.sync.read(await page.locator('canvas').screenshot());
        const [r, g] = data.subarray(data.length / 2 + 640);
        assert.ok(r > 150 && g < 50, `with the function that was chosen there: ${r} ${g}`);
    });

    it('tells why a session did not begin', async () => {
        const texts = await runs(async () => {
            const told: string[] = [];
            const request = navigator.xr!.requestSession;
            for (const error of [new DOMException('no', 'NotAllowedError'), new Error('cable')]) {
                navigator.xr!.requestSession = async () => {
                    throw error;
                };
                api.button.click();
                await new Promise((done) => setTimeout(done, 20));
                told.push(document.getElementById('note')!.textContent!);
            }
            navigator.xr!.requestSession = request;
            return told;
        });
        assert.match(texts[0], /did not let this page use the headset\. Allow it/);
        assert.match(texts[1], /did not start \(cable\)\. Put it on/);
    });

    it('shows each eye what the same view shows alone', async () => {
        const eyes = await runs(async () => {
            await api.begin(0);
            api.bare();
            await api.frames(2);
            return (await api.shot()).map(({ view, port, bytes }) => ({
                difference: api.greatest(bytes, api.alone(view, port)), eye: view.transform.position.x, port,
                found: api.lit(bytes, port.width), wanted: api.wanted(view, port),
            }));
        });
        assert.equal(eyes.length, 2);
        assert.ok(Math.abs(eyes[1].eye - eyes[0].eye - 0.063) < 1e-6);
        for (const { difference, found, wanted, port } of eyes) {
            assert.equal(difference, 0);
            assert.deepEqual([port.width, port.height], [320, 360]);
            near([found.x, found.y], wanted, 0.7);
            // A ball of 40 mm, 0.6 m away, at 180 pixels a unit of tangent.
            near([Math.sqrt(found.count / Math.PI)], [(40 / 600) * 180], 1);
        }
    });

    it('follows frusta that are not symmetric, and draws the panel in them', async () => {
        const eyes = await runs(async () => {
            await api.begin(0);
            const whole = Object.getOwnPropertyDescriptor(XRView.prototype, 'projectionMatrix')!;
            Object.defineProperty(XRView.prototype, 'projectionMatrix', {
                configurable: true,
                get(this: XRView) {
                    const m = Float32Array.from(whole.get!.call(this));
                    m[8] += this.eye === 'left' ? -0.3 : 0.2;
                    m[9] += 0.25;
                    return m;
                },
            });
            const { place } = api.visit!.pointing;
            api.bare();
            await api.frames(2);
            const shots = await api.shot();
            const found = shots.map(({ view, port, bytes }) => ({
                difference: api.greatest(bytes, api.alone(view, port)),
                tangents: api.viewOf(api.visit!.controls.placement, view).tangents,
                found: api.lit(bytes, port.width), wanted: api.wanted(view, port),
            }));
            api.visit!.pointing.place = place;
            await api.frames(2);
            const around = [[390, 550], [440, 550], [390, 600]];
            const corners = (await api.shot()).map(({ view, port, bytes }) => around.map(([x, y]) => {
                const [px, py] = api.projected(view, port, api.onPlane(place!, x, y)).map(Math.floor);
                return bytes[4 * (py * port.width + px)];
            }));
            Object.defineProperty(XRView.prototype, 'projectionMatrix', whole);
            return { found, corners };
        });
        const [left, right] = eyes.found;
        const across = [left, right].map(({ tangents }) => tangents[0] + tangents[1]);
        assert.ok(across[0] < -0.3 && across[1] > 0.2);
        for (const { difference, found, wanted } of eyes.found) {
            assert.equal(difference, 0);
            near([found.x, found.y], wanted, 0.7);
        }
        for (const [inside, ...outside] of eyes.corners) {
            assert.ok(inside > 20);
            assert.deepEqual(outside, [0, 0]);
        }
    });

    it('stands in real size before the viewer, and comes there again when the room is turned', async () => {
        const [first, again] = await runs(async () => {
            await api.begin(5);
            const { controls } = api.visit!;
            const first = controls.placement;
            api.device.quaternion.set(0, Math.SQRT1_2, 0, Math.SQRT1_2);
            api.visit!.space.dispatchEvent(new Event('reset'));
            await api.frames(2);
            const again = [...api.roomOf(controls.placement, api.middle())];
            api.device.quaternion.set(0, 0, 0, 1);
            // The room of the next session begins where the head is in the last frame.
            await api.frames(2);
            const [middle, right] = [api.middle(), [10, 65, 145] as [number, number, number]];
            const seen = { middle: api.roomOf(first, middle), right: api.roomOf(first, right) };
            return [{ scale: first.scale, ...seen }, again] as const;
        });
        assert.equal(first.scale, 1);
        near(first.middle, [0, 0, -0.6]);
        // The patient's right is at the viewer's left: 10 mm are 10 mm.
        near(first.right, [-0.01, 0, -0.6]);
        near(again, [-0.6, 0, 0], 1e-5);
    });

    it('is carried by one hand', async () => {
        const result = await runs(async () => {
            await api.begin(5);
            const { controls } = api.visit!;
            api.visit!.pointing.place = null;
            api.hand('right', [0.1, 1.5, -0.5], [0.1, 1.5, -2]);
            await api.frames(2);
            const start = controls.placement;
            api.press('right', 'squeeze', 1);
            await api.frames(2);
            api.hand('right', [0.2, 1.55, -0.7]);
            await api.frames(2);
            const moved = controls.placement;
            // Turned about the upright by a right angle to the left, in place.
            const grip = api.grip(1);
            const held = api.patientOf(moved, grip);
            api.hand('right', [0.2, 1.55, -0.7], [-1, 1.55, -0.7]);
            await api.frames(2);
            const turned = controls.placement;
            const at = api.roomOf(turned, held);
            const after = api.grip(1);
            api.press('right', 'squeeze', 0);
            await api.frames(2);
            api.hand('right', [0, 1.5, -0.5]);
            await api.frames(2);
            return {
                start, moved, turned, at, after, left: controls.placement,
                right: api.roomOf(turned, [1, 0, 0]), origin: api.roomOf(turned, [0, 0, 0]),
            };
        });
        const { start, moved, turned, at, after, left, right, origin } = result;
        near(moved.position.map((v, k) => v - start.position[k]), [0.1, 0.05, -0.2]);
        near(at, after, 1e-5);
        // What was at the viewer's left (the patient's right) is behind or before now.
        near(right.map((v, k) => (v - origin[k]) * 1000), [0, 0, 1], 1e-3);
        assert.deepEqual(left, turned, 'a hand that lets go leaves it');
        assert.equal(turned.scale, 1);
    });

    it('is scaled by two hands about their middle, and snaps to real size', async () => {
        const scales = await runs(async () => {
            await api.begin(5);
            const { controls } = api.visit!;
            api.visit!.pointing.place = null;
            const grips = async (half: number) => {
                api.hand('left', [-half, 1.5, -0.5], [-half, 1.5, -2]);
                api.hand('right', [half, 1.5, -0.5], [half, 1.5, -2]);
                await api.frames(2);
                const [a, b] = [api.grip(0), api.grip(1)];
                const middle = a.map((v, k) => (v + b[k]) / 2) as [number, number, number];
                const { placement } = controls;
                const held = api.patientOf(placement, middle);
                return { scale: placement.scale, width: Math.abs(a[0] - b[0]), held };
            };
            const start = await grips(0.1);
            api.press('left', 'squeeze', 1);
            api.press('right', 'squeeze', 1);
            await api.frames(2);
            const found = [start, await grips(0.2), await grips(0.101), await grips(0.05)];
            api.press('left', 'squeeze', 0);
            api.press('right', 'squeeze', 0);
            await api.frames(2);
            const small = controls.placement.scale;
            const [x, y] = [60, 75];
            api.visit!.pointing.toggle({ position: [0, 0, 0], orientation: [0, 0, 0, 1] });
            await api.click(x, y);
            return { found, small, real: controls.placement.scale };
        });
        const { found: [start, twice, near1, halved] } = scales;
        near([twice.scale], [twice.width / start.width], 1e-5);
        assert.equal(near1.scale, 1, 'near real size it snaps');
        near([halved.scale], [halved.width / start.width], 1e-5);
        for (const one of [twice, near1, halved]) near(one.held, start.held, 0.02);
        assert.equal(scales.small, halved.scale);
        assert.equal(scales.real, 1, 'by the button');
    });

    it('has a panel that hands press', async () => {
        const result = await runs(async () => {
            await api.begin(5);
            const { app } = api;
            const pulses: number[][] = [];
            const [actuator] = api.device.controllers.right!.inputSource.gamepad!.hapticActuators;
            Object.assign(actuator!, { pulse: async (...values: number[]) => pulses.push(values) });
            await api.click(300, 140); // the second preset
            const chosen = app.look.function.name;
            await api.click(100, 311); // the name of the first object
            const seen = app.appearance(1).visible;
            await api.click(252, 311); // a quarter of its opacity
            const opacity = app.appearance(1).opacity;
            await api.click(106, 247); // the middle of the level
            const [[low], , [high]] = app.look.function.opacities;
            // A hand beside the panel presses nothing.
            await api.click(450, 247);
            const same = app.look.function.opacities[0][0] === low;
            return { chosen, seen, opacity, level: (low + high) / 2, pulses, same };
        });
        assert.equal(result.chosen, 'Red');
        assert.equal(result.seen, false);
        near([result.opacity], [0.25], 0.02);
        near([result.level], [500], 10);
        near(result.pulses[0], [0.3, 15]);
        assert.equal(result.pulses.length, 4);
        assert.ok(result.same);
    });

    it('is left by the panel', async () => {
        const left = await runs(async () => {
            await api.begin(5);
            await api.click(341, 75);
            api.visit = null;
            return api.device.activeSession ?? null;
        });
        assert.equal(left, null);
    });

    it('has a panel that is scrolled, and carried by its frame', async () => {
        const result = await runs(async () => {
            const { objects } = api.scene;
            for (let number = 3; number < 20; number++) {
                objects.push({ ...objects[0], number, name: `Object ${number}` });
            }
            await api.begin(5);
            const { app, device } = api, { pointing } = api.visit!;
            api.hand('right', [0.2, 1.3, -0.2], api.onPanel(200, 480));
            api.tick(0);
            device.controllers.right!.updateAxes('thumbstick', 0, 1);
            for (let i = 0; i < 40; i++) {
                api.tick(50);
                await api.frames(1);
            }
            device.controllers.right!.updateAxes('thumbstick', 0, 0);
            api.real();
            // Beside the end of the panel there are five lines of help, and then the last object.
            await api.click(100, 560 - 16 - 5 * 22 - 8 - 17);
            const hidden = objects.filter(({ number }) => !app.appearance(number).visible);
            objects.length = 2;
            const before = api.onPanel(200, 280);
            api.hand('right', [0.2, 1.3, -0.2], api.onPanel(200, 577));
            await api.frames(2);
            api.press('right', 'squeeze', 1);
            await api.frames(2);
            const { placement } = api.visit!.controls;
            api.hand('right', [0.2, 1.4, -0.3]);
            await api.frames(2);
            api.press('right', 'squeeze', 0);
            await api.frames(2);
            const after = api.onPanel(200, 280);
            const [middle, out] = [280, 281].map((y) => api.onPlane(pointing.place!, 200, y));
            return {
                hidden: hidden.map(({ name }) => name),
                moved: after.map((v, k) => v - before[k]), down: out.map((v, k) => v - middle[k]),
                same: placement === api.visit!.controls.placement,
            };
        });
        assert.deepEqual(result.hidden, ['Object 19']);
        near(result.moved, [0, 0.1, -0.1], 1e-3);
        near(result.down, [0, -0.001, 0]);
        assert.ok(result.same, 'the patient stays');
    });

    it('lets buttons change presets, the thumbstick the window, and put everything back', async () => {
        const result = await runs(async () => {
            await api.begin(5);
            api.visit!.pointing.place = null;
            const { app } = api, { device } = api;
            const tap = async (side: 'left' | 'right', name: string) => {
                api.press(side, name, 1);
                await api.frames(3);
                api.press(side, name, 0);
                await api.frames(2);
            };
            await tap('right', 'a-button');
            await tap('right', 'a-button');
            const third = app.look.function.name;
            await tap('left', 'x-button');
            const second = app.look.function.name;
            const before = app.look.function.opacities.map(([v]) => v);
            api.tick(0);
            device.controllers.right!.updateAxes('thumbstick', 0, -1);
            for (let i = 0; i < 20; i++) {
                api.tick(50);
                await api.frames(1);
            }
            device.controllers.right!.updateAxes('thumbstick', 0, 0);
            await api.frames(1);
            const after = app.look.function.opacities.map(([v]) => v);
            api.press('left', 'y-button', 1);
            for (let i = 0; i < 25; i++) {
                api.tick(50);
                await api.frames(1);
            }
            api.press('left', 'y-button', 0);
            await api.frames(2);
            api.real();
            const { place } = api.visit!.pointing;
            await tap('left', 'thumbstick');
            const moved = after.map((v, i) => v - before[i]), shown = api.visit!.pointing.place !== null;
            return { third, second, moved, reset: app.look.function.name, place, shown };
        });
        assert.deepEqual([result.third, result.second, result.reset], ['Blue', 'Red', 'White']);
        // A quarter of the range, 1000 HU, in a second, as far as frames tell it.
        assert.ok(result.moved.every((v) => v > 200 && v < 300), `${result.moved}`);
        assert.ok(result.place === null && result.shown);
    });

    it('is cut by a plane in the hand, which can be left there', async () => {
        const counts = await runs(async () => {
            await api.begin(5);
            const lit = async () => {
                const [{ view, port }] = await api.shot();
                return api.lit(api.alone(view, port), port.width);
            };
            api.hand('right', [0, 1.3, -0.6], [0, 1.3, -2]);
            const whole = await lit();
            const button = async () => {
                api.press('right', 'b-button', 1);
                await api.frames(3);
                api.press('right', 'b-button', 0);
                await api.frames(2);
            };
            await button();
            const held = await lit(), inHand = api.app.plane;
            api.hand('right', [0.3, 1.3, -0.6]);
            await api.frames(2);
            const aside = await lit();
            api.hand('right', [0, 1.3, -0.6]);
            await api.frames(2);
            const blade = api.patientOf(api.visit!.controls.placement, api.grip(1));
            await button();
            api.hand('right', [0.3, 1.3, -0.6]);
            await api.frames(2);
            const left = await lit(), plane = api.app.plane!;
            await button();
            return { whole, held, aside, left, plane, blade, inHand, none: await lit(), gone: api.app.plane };
        });
        const { whole, held, aside, left, none } = counts;
        near([held.count / whole.count], [0.5], 0.2);
        assert.ok(held.x > whole.x + 2, 'what is to the left of the hand is cut away');
        assert.equal(aside.count, 0);
        near([left.count], [held.count], 12);
        assert.deepEqual([none.count, counts.gone], [whole.count, null]);
        assert.equal(counts.inHand, null, 'one in the hand is not yet that of the page');
        // The room's x is the patient's -x.
        const { normal, offset } = counts.plane;
        assert.ok(normal[0] < -0.9);
        near([normal.reduce((sum, n, k) => sum + n * counts.blade[k], 0)], [offset], 1e-3);
    });

    it('knows hands without controllers', async () => {
        const result = await runs(async () => {
            await api.begin(5);
            const { device, app } = api, { controls, pointing } = api.visit!;
            device.primaryInputMode = 'hand';
            api.hand('left', [-0.3, 1.0, -0.2]);
            api.hand('right', [0.2, 1.3, -0.2], api.onPanel(300, 140));
            await api.frames(2);
            device.hands.right!.updatePinchValue(1);
            await api.frames(2);
            device.hands.right!.updatePinchValue(0);
            await api.frames(2);
            const chosen = app.look.function.name;
            // A pinch beside the panel carries, and so does a grasp.
            api.hand('right', [0.2, 1.3, -0.2], [3, 1.3, -2]);
            await api.frames(2);
            const before = controls.placement.position;
            device.hands.right!.updatePinchValue(1);
            await api.frames(2);
            api.hand('right', [0.3, 1.3, -0.2]);
            await api.frames(2);
            device.hands.right!.updatePinchValue(0);
            await api.frames(2);
            const after = controls.placement.position;
            const relaxed = api.squeeze(1);
            device.hands.right!.poseId = 'point';
            await api.frames(2);
            const bent = api.squeeze(1);
            device.hands.right!.poseId = 'default';
            // The open palm before the eyes hides the panel.
            const shown = pointing.place !== null;
            api.showPalm();
            api.tick(0);
            for (let i = 0; i < 16; i++) {
                api.tick(50);
                await api.frames(1);
            }
            api.real();
            const moved = after[0] - before[0], hidden = pointing.place === null;
            return { chosen, moved, relaxed, bent, shown, hidden };
        });
        assert.equal(result.chosen, 'Red');
        near([result.moved], [0.1], 1e-3);
        assert.ok(result.relaxed < 0.3 && result.bent > 0.6, `${result.relaxed} ${result.bent}`);
        assert.ok(result.shown && result.hidden, `${result.shown} ${result.hidden}`);
    });

    it('shows the room behind the scene', async () => {
        const { found, opaque } = await runs(async () => {
            await api.begin(0, 'immersive-ar');
            api.bare();
            await api.frames(2);
            const [{ view, port }] = await api.shot();
            const { renderer } = api;
            const found = api.lit(api.alone(view, port), port.width);
            await api.end();
            const opaque = renderer.opaque;
            return { found, opaque };
        });
        assert.ok(found.count > 100 && found.alpha === 0);
        assert.ok(opaque, 'the page has its background again');
    });

    it('keeps what is shown at lower levels', async () => {
        const counts = await runs(async () => {
            await api.begin(0);
            api.bare();
            const counts: { level: number; count: number; x: number; y: number }[] = [];
            for (let level = 0; level < api.visit!.report.levels.length; level++) {
                api.hold(level);
                await api.frames(2);
                const [, { bytes, port }] = await api.shot();
                counts.push({ level, ...api.lit(bytes, port.width) });
            }
            return counts;
        });
        for (const { count, x, y } of counts) {
            near([count / counts[0].count], [1], 0.15);
            near([x, y], [counts[0].x, counts[0].y], 0.5);
        }
    });

    it('goes down when frames are late, and up again', async () => {
        const levels = await runs(async () => {
            await api.begin(5);
            const { budget } = api.visit!;
            // The level was held by a function of its own.
            delete (budget as { frame?: unknown }).frame;
            budget.level = 0;
            api.tick(0);
            const run = async (ms: number, frames: number) => {
                for (let i = 0; i < frames; i++) {
                    api.tick(ms);
                    await api.frames(1);
                }
                return budget.level;
            };
            const slow = await run(40, 6), quality = api.visit!.panel.quality;
            const fast = await run(13.9, 130);
            api.real();
            return { slow, quality, fast, report: api.visit!.report };
        });
        assert.ok(levels.slow >= 3, `${levels.slow}`);
        assert.match(levels.quality, /^Draft: edges × 0\.\d+, steps × /);
        assert.ok(levels.fast < levels.slow, `${levels.fast}`);
        const { rate, late, width, height, multiview, levels: counts } = levels.report;
        assert.deepEqual([rate, width, height, multiview], [72, 320, 360, false]);
        assert.ok(late >= 6 && counts.reduce((sum, n) => sum + n, 0) >= 136);
    });

    it('draws both eyes in one pass where layers can be had', async () => {
        const eyes = await runs(async () => {
            api.offerLayers();
            await api.begin(0, 'immersive-vr', ['layers']);
            api.bare();
            await api.frames(2);
            const whole = (await api.layers()).map(({ view, port, bytes }) => ({
                difference: api.greatest(bytes, api.alone(view, port)), ...api.lit(bytes, port.width),
            }));
            api.hold(4);
            api.app.setFunction(api.scene.presets[1]);
            await api.frames(2);
            const small = await api.layers();
            const { pointing } = api.visit!;
            pointing.toggle({ position: [0, 0, 0], orientation: [0, 0, 0, 1] });
            await api.frames(2);
            const panel = (await api.layers()).map(({ view, port, bytes }) => {
                const corner = api.onPlane(pointing.place!, 390, 550);
                const [x, y] = api.projected(view, port, corner).map(Math.floor);
                return bytes[4 * (y * port.width + x)];
            });
            api.withdrawLayers();
            return {
                whole,
                small: small.map(({ port, bytes }) => {
                    const green = bytes.filter((v, i) => i % 4 === 1 && v > 50).length;
                    return { ...api.lit(bytes, port.width), green };
                }),
                panel,
            };
        });
        assert.equal(eyes.whole.length, 2);
        eyes.whole.forEach(({ difference, count, x, y }, i) => {
            assert.ok(difference <= 1 && count > 100, `${difference} ${count}`);
            const small = eyes.small[i];
            near([small.count / count], [1], 0.15);
            near([small.x, small.y], [x, y], 0.5);
            assert.equal(small.green, 0, 'each eye is drawn in red now');
            assert.ok(eyes.panel[i] > 20);
        });
    });
});

describe('the budget of frames', () => {
    const costs = [1, 0.78, 0.65, 0.44, 0.26, 0.165];
    const period = 1000 / 72;
    /**
     * Levels over frames of a device on which level 0 takes `load` periods; a display shows whole periods.
     */
    const trace = (load: (frame: number) => number, frames: number, level = 4) => {
        const budget = new Budget(costs, level);
        return Array.from({ length: frames }, (_, frame) => {
            const at = budget.level;
            const work = load(frame) * costs[at];
            budget.frame(Math.ceil(work) * period, period);
            return { level: at, isLate: work > 1 };
        });
    };
    const late = (frames: { isLate: boolean }[]) => frames.filter(({ isLate }) => isLate).length;

    it('climbs to the best level that is in time, and seldom tries a better one', () => {
        for (const load of [0.7, 1.2, 1.7, 3, 5]) {
            const frames = trace(() => load, 20000);
            const best = costs.findIndex((cost) => cost * load <= 1);
            const settled = frames.slice(4000);
            const mean = settled.reduce((sum, { level }) => sum + level, 0) / settled.length;
            assert.ok(Math.abs(mean - best) < 0.1, `${load}: ${mean} instead of ${best}`);
            assert.ok(late(settled) / settled.length < 0.002, `${load}: ${late(settled)} late`);
        }
    });

    it('answers a load at once, and forgets it', () => {
        const frames = trace((frame) => (frame >= 1200 && frame < 1800 ? 3 : 0.9), 4000, 0);
        assert.ok(late(frames.slice(1200, 1800)) <= 12, `${late(frames.slice(1200, 1800))} late`);
        assert.ok(frames[1203].level >= 4);
        assert.equal(frames[3999].level, 0);
    });

    it('ignores pauses and single late frames', () => {
        const budget = new Budget(costs, 0);
        for (let frame = 0; frame < 300; frame++) {
            const ms = frame % 40 === 20 ? 3 * period : frame % 50 === 1 ? 5000 : period;
            budget.frame(ms, period);
        }
        assert.equal(budget.level, 0);
    });
});
