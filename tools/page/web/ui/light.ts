// How surfaces are lit.
import { dot, unit } from '../render/vectors.ts';
import type { Light } from '../types.ts';
import type { App } from './app.ts';
import { axesOf } from './camera.ts';
import { button, checkbox, element, slider } from './elements.ts';
import { sum } from './vectors.ts';

const HEAD: Light = { direction: [0, 0, 1], fixedTo: 'camera', fill: 0 };

/**
 * Turns the key light as a drag would turn a ball of the size of the picture; pixels, and half its height.
 */
export function dragLight(app: App, dx: number, dy: number, radius: number): void {
    const { light } = app.look;
    const axes = axesOf(app.camera);
    const seen =
        light.fixedTo === 'camera' ? unit(light.direction) : axes.map((a) => dot(a, unit(light.direction)));
    const [x, y] = [seen[0] + dx / radius, seen[1] - dy / radius];
    // Behind the picture there is nothing to light.
    const far = Math.max(Math.hypot(x, y), 1e-9);
    const short = Math.min(1, 0.98 / far);
    const [a, b] = [x * short, y * short];
    const aimed = [a, b, Math.sqrt(Math.max(1 - a * a - b * b, 0))];
    const world = sum(axes, aimed);
    app.setLight({ direction: light.fixedTo === 'camera' ? [aimed[0], aimed[1], aimed[2]] : world });
}

export function lightPanel(app: App, into: HTMLElement): void {
    const lit = checkbox('Light', (shade) => app.setMaterial({ shade }));
    const fixed = checkbox('With the patient', (on) => {
        const axes = axesOf(app.camera);
        const { direction } = app.look.light;
        // The light stays where it is now.
        const seen = axes.map((a) => dot(a, direction)) as [number, number, number];
        const world = sum(axes, direction);
        if (on !== (app.look.light.fixedTo === 'patient')) {
            app.setLight(
                on ? { fixedTo: 'patient', direction: world } : { fixedTo: 'camera', direction: seen },
            );
        }
    });
    const occlusion = slider('Occlusion', '', (value) => app.setMaterial({ occlusion: value }));
    occlusion.setRange(0, 1, 0.01);
    into.append(
        element(
            'div',
            { class: 'row' },
            lit.row,
            fixed.row,
            button('Headlight', () => app.setLight(HEAD), {
                title: 'From where the viewer is',
                class: 'push',
            }),
        ),
        occlusion.row,
    );
    const show = () => {
        const { material } = app.look.function;
        lit.box.checked = material.shade;
        fixed.box.checked = app.look.light.fixedTo === 'patient';
        occlusion.set(material.occlusion);
    };
    app.on('look', show);
    show();
}
