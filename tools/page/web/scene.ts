// What the file carries: the scene as JSON, and its parts as text.
import { bytesOf } from './text.ts';
import type { Part, Scene } from './types.ts';
import { isScene } from './ui/checks.ts';

/** What the worker is given. */
export type Data = Part & { data: Uint8Array };

/** A sentence for the reader of a page that has been changed on its way. */
export const DAMAGED =
    'The data of this page is damaged. Get the file again from where you have it: a transfer ' +
    'that was cut off, or a program that edits web pages, may have changed it.';

/**
 * The bytes of a text (text.ts).
 *
 * @throws if the text is not that of so many bytes
 */
export function decoded(text: string, bytes: number): Uint8Array<ArrayBuffer> {
    if (text.length !== 2 * Math.ceil((8 * bytes) / 13) || /[^!#-%'-;=-~]/.test(text)) throw Error(DAMAGED);
    return bytesOf(text, bytes);
}

/** Takes what the file carries out of the document; null: it carries nothing. */
export function sceneIn(document: Document): { scene: Scene; data: Data[] } | null {
    const text = (id: string) => {
        const element = document.getElementById(id);
        const content = element?.textContent?.trim() ?? null;
        // The text is as large as the data, and of no use any more.
        if (id !== 'scene') element?.remove();
        return content;
    };
    const json = text('scene');
    if (json === null) return null;
    let scene: unknown;
    try {
        scene = JSON.parse(json);
    } catch {
        throw Error(DAMAGED);
    }
    if (!isScene(scene)) throw Error(DAMAGED);
    const data = scene.parts.map((part, i) => ({
        ...part,
        data: decoded(text(`data-${i}`) ?? '', part.bytes),
    }));
    return { scene, data };
}
