/** What keeps a scene from being shown, in a sentence for a reader of the page. */
export class Refusal extends Error {}

/** What a reader can do about data that are not as they were written. */
export const GET_AGAIN = 'Get the page again from where it was made.';

export function tooLarge(what: string): Refusal {
    return new Refusal(`The scene is too large for a page: ${what}. Make the page of a part of it.`);
}
