//! Parts that commands share.
//!
//! | file | subject |
//! |---|---|
//! | `flags` | flags that several commands have, and how their texts are parsed; `viewing`: where a scene is seen from; `looks`, `light`: how splats look |
//! | `inputs` | the volume and the region of interest, and the records of their files; `padding`: voxels without a value; `texts`: small files of text |
//! | `splat_files` | reading and writing splats, whatever their layout |
//! | `outputs` | checks before anything is written; `lock`: one run per output; `interrupted`: what `--resume` goes on from |
//! | `evaluation` | how splats are measured against a volume |
//! | `console` | results to stdout, messages to stderr; `figures`: how numbers are written |
//! | `help` | the short help, by task |
//! | `progress` | the bar or the lines of long work; `waiting`: a line for work that is not told otherwise |
//! | `failure` | how the program ends: errors and exit codes |
//! | `signals` | Ctrl-C and similar signals |
//! | `terminal`, `clock`, `memory`, `version` | the machine and the program itself |

pub mod clock;
pub mod console;
pub mod evaluation;
pub mod failure;
pub mod figures;
pub mod flags;
pub mod help;
pub mod inputs;
pub mod interrupted;
pub mod light;
pub mod lock;
pub mod looks;
pub mod memory;
pub mod outputs;
pub mod padding;
pub mod progress;
pub mod signals;
pub mod splat_files;
pub mod terminal;
pub mod texts;
pub mod version;
pub mod viewing;
pub mod waiting;
