//! What users may do to the program, and the tests that show what it does then.
//!
//! long: the rows of the table, each with the tests that show it.

use super::{Row, Test, Verdict::*, t};

const NIFTI: &str = "engine/src/volume/nifti/tests.rs";
const ROI: &str = "engine/src/volume/roi.rs";
const PLY: &str = "engine/src/splat/ply/tests/mod.rs";
const FIT: &str = "tests/tests/fit.rs";
const REFUSALS: &str = "tools/cli/tests/refusals.rs";
const WHOLE: &str = "tools/cli/tests/whole.rs";
const INTERRUPTIONS: &str = "tools/cli/tests/interruptions.rs";
const SURROUNDINGS: &str = "tools/cli/tests/surroundings.rs";
const OUTPUT: &str = "engine/src/output.rs";
const DICOM: &str = "engine/src/volume/dicom/tests/mod.rs";
const FUZZ: &str = "tools/fuzz/tests/readers.rs";
const MEMORY: &str = "tools/fuzz/tests/memory.rs";

/// A row of [`REFUSALS`], or several.
const fn refused(cases: &'static [&'static str]) -> Test {
    t(REFUSALS, "bad_inputs_are_refused_and_nothing_is_touched", cases)
}

/// A row of what is malformed in NIfTI, or several.
const fn malformed(cases: &'static [&'static str]) -> Test {
    t(NIFTI, "malformed_files_are_refused", cases)
}

/// A row of what is odd in NIfTI, or several.
const fn odd(cases: &'static [&'static str]) -> Test {
    t(NIFTI, "oddities_that_are_read", cases)
}

/// A row of what is wrong in a PLY, or several.
const fn wrong_ply(cases: &'static [&'static str]) -> Test {
    t(PLY, "wrong_files_are_refused_with_a_reason", cases)
}

/// Bad inputs and what goes wrong around a run.
pub const INPUTS: &[Row] = &[
    Row {
        number: 1,
        input: "an empty .nii or .nii.gz",
        must: "65, told as empty",
        tests: &[malformed(&["empty", "gzip of nothing"]), refused(&["the volume is empty"])],
        verdict: Holds,
    },
    Row {
        number: 2,
        input: "fewer bytes than a header",
        must: "65 with both numbers",
        tests: &[malformed(&["short", "short gzip", "short NIfTI-2"])],
        verdict: Holds,
    },
    Row {
        number: 3,
        input: "gzip called .nii, plain called .nii.gz",
        must: "read as what it is, with a note",
        tests: &[t(NIFTI, "compression_is_recognised_by_content", &[])],
        verdict: Holds,
    },
    Row {
        number: 4,
        input: "gzip inside gzip",
        must: "65",
        tests: &[malformed(&["gzip in gzip"])],
        verdict: Holds,
    },
    Row {
        number: 5,
        input: "gzip of several members",
        must: "read",
        tests: &[t(NIFTI, "compression_is_recognised_by_content", &[])],
        verdict: Holds,
    },
    Row {
        number: 6,
        input: "a wrong checksum, bytes after gzip",
        must: "65; zeros are padding; `--lenient` accepts",
        tests: &[
            malformed(&["gzip CRC", "bytes after gzip"]),
            t(NIFTI, "leniency_accepts_damage_beside_the_voxels", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 7,
        input: "voxels cut short",
        must: "65, bytes expected and found",
        tests: &[malformed(&["truncated", "truncated in gzip", "gzip cut"])],
        verdict: Holds,
    },
    Row {
        number: 8,
        input: "bytes after the voxels",
        must: "read",
        tests: &[odd(&["bytes after the voxels"])],
        verdict: Holds,
    },
    Row {
        number: 9,
        input: "megabytes that unpack to 4 GiB, a claim of 20 GB",
        must: "65 before memory is taken, less than 100 MB",
        tests: &[
            malformed(&["bomb", "gzip claim"]),
            t(MEMORY, "memory_follows_what_is_read", &["wide.nii.gz", "claim.nii.gz"]),
        ],
        verdict: Holds,
    },
    Row {
        number: 10,
        input: "dimensions of 0, negative, too many, too large",
        must: "65 with field and value",
        tests: &[malformed(&["rank 0", "rank 8", "rank -3", "dim 0", "dim -8", "overflow", "product"])],
        verdict: Holds,
    },
    Row {
        number: 11,
        input: "NIfTI-2; ANALYZE 7.5",
        must: "read; 65 with a hint",
        tests: &[
            t(NIFTI, "every_scalar_type_in_both_byte_orders_and_versions", &[]),
            malformed(&["ANALYZE"]),
        ],
        verdict: Holds,
    },
    Row {
        number: 12,
        input: ".hdr without .img, either of a pair given",
        must: "66; the pair is read",
        tests: &[t(NIFTI, "pairs_are_found_from_either_file", &[])],
        verdict: Holds,
    },
    Row {
        number: 13,
        input: "an offset of the voxels of 512, 0, NaN, ±1e30, within the header",
        must: "honoured, the usual one, 65",
        tests: &[
            odd(&["offset 0", "a gap without extension"]),
            malformed(&["offset NaN", "offset -1e30", "offset 1e30", "offset 100", "offset past the end"]),
        ],
        verdict: Holds,
    },
    Row {
        number: 14,
        input: "header extensions of 0, negative, 2 GiB; a flag and none",
        must: "65; read",
        tests: &[
            malformed(&["extension 0", "extension -16", "extension 2 GiB"]),
            odd(&["a flag without extension", "an extension"]),
        ],
        verdict: Holds,
    },
    Row {
        number: 15,
        input: "a size of voxels that is not that of their type",
        must: "the type counts, with a note",
        tests: &[odd(&["bitpix 0"])],
        verdict: Holds,
    },
    Row {
        number: 16,
        input: "colour, complex, 128 bits, unknown types",
        must: "65 with the type",
        tests: &[malformed(&[
            "datatype 0",
            "binary",
            "complex",
            "RGB",
            "RGBA",
            "float128",
            "complex256",
            "no datatype",
        ])],
        verdict: Holds,
    },
    Row {
        number: 17,
        input: "big-endian files of every type",
        must: "as little-endian ones",
        tests: &[t(NIFTI, "every_scalar_type_in_both_byte_orders_and_versions", &[])],
        verdict: Holds,
    },
    Row {
        number: 18,
        input: "a slope of 0, NaN, ∞, negative",
        must: "none, none with a note, 65, applied",
        tests: &[odd(&["slope 0", "slope NaN", "negative slope"]), malformed(&["slope inf", "inter inf"])],
        verdict: Holds,
    },
    Row {
        number: 19,
        input: "values beyond 32-bit floats",
        must: "65; never an infinity on the device",
        tests: &[malformed(&["float64 1e300"])],
        verdict: Holds,
    },
    Row {
        number: 20,
        input: "voxels that are NaN or ∞, in the region and beside it",
        must: "left out; 65 if they are most of the region; ignored beside it",
        tests: &[t(ROI, "voxels_without_a_value_are_excluded", &[])],
        verdict: Holds,
    },
    Row {
        number: 21,
        input: "the whole range of 16 bits, padding of -3024",
        must: "clipped to `--hu-range`; metal and padding spoil nothing",
        tests: &[
            t("tests/tests/extremes/real.rs", "extremes_of_real_data", &[]),
            t("tests/tests/extremes/storage.rs", "n11_intensities", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 22,
        input: "integers beyond 2²⁴",
        must: "rounded, with a warning",
        tests: &[t(NIFTI, "integers_beyond_f32_round_and_infinities_stay", &[])],
        verdict: Holds,
    },
    Row {
        number: 23,
        input: "a constant volume",
        must: "fitted exactly, a PSNR of ∞ and no NaN",
        tests: &[
            t(WHOLE, "a_constant_volume_is_fitted_exactly", &[]),
            t(FIT, "a_constant_region_is_exact", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 24,
        input: "one slice, one voxel, 2 × 2 × 2",
        must: "works",
        tests: &[
            t(FIT, "small_regions_and_thin_volumes", &[]),
            t("engine/src/volume/tests.rs", "one_voxel_is_a_volume", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 25,
        input: "a series in time",
        must: "2, choose one by `--volume-index`",
        tests: &[t(NIFTI, "one_volume_of_a_series", &[])],
        verdict: Holds,
    },
    Row {
        number: 26,
        input: "an affine that is singular, NaN, 0; a quaternion of NaN, rounded",
        must: "65; a rounded one is mended",
        tests: &[
            malformed(&["sform NaN", "sform 0", "sform flat", "quaternion NaN", "quaternion 1.1"]),
            t(NIFTI, "the_affine_comes_from_sform_then_qform_then_pixdim", &["rounded"]),
        ],
        verdict: Holds,
    },
    Row {
        number: 27,
        input: "a sheared affine, a tilted gantry",
        must: "exact, with a note",
        tests: &[
            t(NIFTI, "the_affine_comes_from_sform_then_qform_then_pixdim", &["shear"]),
            t("tests/tests/extremes/places.rs", "n14_oblique_left_handed_and_sheared", &[]),
            t(DICOM, "a_tilt_is_a_shear_and_nothing_is_resampled", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 28,
        input: "no affine at all",
        must: "read, left and right are unknown",
        tests: &[t(NIFTI, "the_affine_comes_from_sform_then_qform_then_pixdim", &["neither"])],
        verdict: Holds,
    },
    Row {
        number: 29,
        input: "distances of voxels of 0, negative, 1e-6, 1e6",
        must: "65, their size, a note on the unit",
        tests: &[
            malformed(&["pixdim 0", "pixdim NaN"]),
            t(NIFTI, "the_affine_comes_from_sform_then_qform_then_pixdim", &["negative pixdim", "1e6 mm"]),
            odd(&["nanometres"]),
        ],
        verdict: Holds,
    },
    Row {
        number: 30,
        input: "a mask of zeros",
        must: "3",
        tests: &[refused(&["the mask is zero everywhere"])],
        verdict: Holds,
    },
    Row {
        number: 31,
        input: "a mask of one voxel",
        must: "a splat or more, no NaN, an end",
        tests: &[t(FIT, "small_regions_and_thin_volumes", &[])],
        verdict: Holds,
    },
    Row {
        number: 32,
        input: "a mask on another grid; one that is elsewhere",
        must: "resampled with a warning; 65 with both boxes",
        tests: &[
            t(ROI, "a_mask_on_another_grid_is_resampled", &[]),
            t(ROI, "masks_that_cannot_be_related", &[]),
            refused(&["mask and volume are apart"]),
        ],
        verdict: Holds,
    },
    Row {
        number: 33,
        input: "a map of labels; fractions",
        must: "2 with the labels; a soft mask",
        tests: &[
            t(ROI, "a_label_map_lists_what_can_be_chosen", &[]),
            t(ROI, "masks_of_every_kind", &[]),
            refused(&["no label was chosen"]),
        ],
        verdict: Holds,
    },
    Row {
        number: 34,
        input: "a soft mask below 0, above 1, NaN",
        must: "rounding is clamped, all else 65",
        tests: &[t(ROI, "masks_of_every_kind", &[])],
        verdict: Holds,
    },
    Row {
        number: 35,
        input: "volume and mask swapped",
        must: "65, or a warning",
        tests: &[t(SURROUNDINGS, "volume_and_mask_that_were_swapped_are_told", &[])],
        verdict: Holds,
    },
    Row {
        number: 36,
        input: "a PLY cut short, a count of 1e9, 2⁶⁴ − 1, 10³⁰, negative",
        must: "65 before memory is taken",
        tests: &[
            wrong_ply(&["truncated", "count 10^9", "count 2^64 - 1", "count 10^30", "negative count"]),
            t(MEMORY, "memory_follows_what_is_read", &["a.ply"]),
        ],
        verdict: Holds,
    },
    Row {
        number: 37,
        input: "a PLY with duplicates, lists, doubles, big-endian, text, CRLF, Latin-1, endless lines",
        must: "read, or 65 with the reason; a header of 64 KiB at most",
        tests: &[
            wrong_ply(&[
                "property twice",
                "element twice",
                "list property",
                "endless line",
                "200 000 properties",
                "NUL",
            ]),
            t(
                PLY,
                "files_of_others_are_read",
                &["double", "big endian", "ASCII", "CRLF", "obj_info", "Latin-1"],
            ),
        ],
        verdict: Holds,
    },
    Row {
        number: 38,
        input: "splats of NaN, ∞, no rotation, absurd scales",
        must: "dropped and counted; refused where the reader is strict",
        tests: &[t(PLY, "unusable_splats_are_dropped_and_counted", &[])],
        verdict: Holds,
    },
    Row {
        number: 39,
        input: "a PLY without splats",
        must: "told, 65; never written",
        tests: &[
            t(PLY, "no_splats_can_be_read_but_not_written", &[]),
            t(
                "engine/src/splat/file.rs",
                "a_file_is_known_by_its_content_and_written_by_its_extension",
                &["none.ply"],
            ),
        ],
        verdict: Holds,
    },
    Row {
        number: 40,
        input: "more splats than memory holds",
        must: "71 or 75 with bytes needed and there, before they are taken",
        tests: &[
            t("tests/tests/memory.rs", "large_objects_take_no_more_than_is_free", &[]),
            t("engine/src/memory.rs", "what_is_too_much_is_refused_before_it_is_taken", &[]),
            t("xr-app/tests/program.rs", "a_memory_budget_is_kept_to_or_refused", &[]),
        ],
        verdict: Partly("of the checks; no file of 50 million splats is read in a test"),
    },
    Row {
        number: 41,
        input: "a PLY with colours and no intensity",
        must: "shown in its colours",
        tests: &[
            t("tests/tests/alpha.rs", "standard_splats_have_their_own_colours", &[]),
            refused(&["splats without an intensity"]),
        ],
        verdict: Holds,
    },
    Row {
        number: 42,
        input: "control characters in a file",
        must: "escaped where they are shown, never obeyed",
        tests: &[
            wrong_ply(&["control characters"]),
            t("tools/cli/src/shared/terminal.rs", "control_characters_are_shown_and_not_obeyed", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 43,
        input: "transfer functions unsorted, doubled, NaN, out of range, of one point or a million",
        must: "65 with the place; a doubled intensity is a step",
        tests: &[
            t("engine/src/transfer/file/tests.rs", "what_is_wrong_is_told", &[]),
            t("engine/src/transfer/function.rs", "what_makes_no_function_is_refused", &[]),
            t(
                "engine/src/transfer/function.rs",
                "of_several_points_at_one_intensity_the_last_holds_to_the_right",
                &[],
            ),
        ],
        verdict: Holds,
    },
    Row {
        number: 44,
        input: "configurations of unknown keys, wrong types, impossible values",
        must: "2 with the key and the nearest known one",
        tests: &[refused(&[
            "an unknown key in the configuration",
            "a wrong type in the configuration",
            "a configuration that is no TOML",
            "a configuration without end",
            "a negative learning rate",
            "far too many iterations",
        ])],
        verdict: Holds,
    },
    Row {
        number: 45,
        input: "no loader, no device, only a CPU, a missing feature",
        must: "69 with the devices and what they lack",
        tests: &[
            t(SURROUNDINGS, "without_a_device_it_says_so", &[]),
            t(
                "engine/src/gpu/choice.rs",
                "the_fastest_usable_device_is_chosen_unless_the_user_says_otherwise",
                &[],
            ),
            refused(&["a device that is not there"]),
        ],
        verdict: Holds,
    },
    Row {
        number: 46,
        input: "a device of small storage buffers",
        must: "cut into chunks, the same result",
        tests: &[
            t(FIT, "a_fit_in_chunks_differs_by_rounding", &[]),
            t("tests/tests/volume_mode.rs", "small_devices_render_the_same", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 47,
        input: "the n-th allocation of the device fails",
        must: "75, everything freed",
        tests: &[t("tests/tests/nth_failure.rs", "device_memory_runs_out", &[])],
        verdict: Holds,
    },
    Row {
        number: 48,
        input: "the host has no memory",
        must: "71",
        tests: &[
            t("engine/src/memory.rs", "what_is_too_much_is_refused_before_it_is_taken", &[]),
            t("tests/tests/nth_failure.rs", "host_memory_runs_out", &[]),
            t("tools/cli/tests/host_memory.rs", "without_memory_it_ends_with_its_exit_code", &[]),
        ],
        verdict: Partly("the program; lavapipe itself dies where it gets no memory"),
    },
    Row {
        number: 49,
        input: "the device is lost",
        must: "a fit keeps its checkpoint, 75; the viewer makes the device again",
        tests: &[
            t("tests/tests/nth_failure.rs", "a_device_is_lost", &[]),
            t("tools/cli/tests/view.rs", "a_lost_device_is_made_again", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 50,
        input: "a pass that holds the device for long",
        must: "cut by a budget of time",
        tests: &[t(FIT, "no_pass_holds_the_device_for_long_and_memory_is_accounted_for", &[])],
        verdict: Holds,
    },
    Row {
        number: 51,
        input: "the disk is full on the way",
        must: "74, what was there stays",
        tests: &[
            t(OUTPUT, "a_failed_write_keeps_the_old_file_and_leaves_nothing", &[]),
            t(INTERRUPTIONS, "a_limit_of_the_size_of_files_is_an_error", &[]),
            t(WHOLE, "a_full_stdout_is_an_error", &[]),
            t("tools/cli/tests/failing_writes.rs", "whichever_block_is_refused", &[]),
            t("tools/cli/tests/failing_writes.rs", "whatever_of_a_fit_the_disk_has_no_room_for", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 52,
        input: "an output's folder that is missing, a file, read-only",
        must: "73 before anything is computed",
        tests: &[
            refused(&["the output's folder is missing", "the output's folder is a file"]),
            t(REFUSALS, "a_folder_that_may_not_be_written_is_found_out_first", &[]),
            t(OUTPUT, "places_that_cannot_hold_an_output", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 53,
        input: "an output that exists",
        must: "73; with `--force` replaced at once, a link instead of its target",
        tests: &[
            refused(&["the output exists", "a file beside the output exists"]),
            t(OUTPUT, "an_existing_output_needs_force", &[]),
            t(OUTPUT, "force_replaces_a_link_and_not_its_target", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 54,
        input: "an output that is the input, by a link too",
        must: "73",
        tests: &[refused(&["the output is the input"]), t(OUTPUT, "one_file_under_several_names", &[])],
        verdict: Holds,
    },
    Row {
        number: 55,
        input: "two runs with one output",
        must: "75 for the second, with the process that is there",
        tests: &[t(INTERRUPTIONS, "a_second_run_on_the_same_output_is_told_to_wait", &[])],
        verdict: Holds,
    },
    Row {
        number: 56,
        input: "SIGINT, SIGTERM, SIGHUP; twice",
        must: "the splats are written, 130, 143, 129; the second ends at once",
        tests: &[
            t(INTERRUPTIONS, "a_signal_leaves_usable_splats", &[]),
            t(SURROUNDINGS, "a_second_signal_ends_at_once_and_a_hangup_saves", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 57,
        input: "kill -9, then `--resume`",
        must: "the bytes of a run that went through",
        tests: &[t(INTERRUPTIONS, "an_interrupted_fit_goes_on_to_the_same_bytes", &[])],
        verdict: Holds,
    },
    Row {
        number: 58,
        input: "`--resume` with other settings or another volume",
        must: "2 with each difference",
        tests: &[
            t(INTERRUPTIONS, "an_interrupted_fit_goes_on_to_the_same_bytes", &[]),
            t("tools/cli/src/commands/fit/checkpoint.rs", "another_configuration_is_told_by_its_key", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 59,
        input: "a damaged state of a fit",
        must: "found out, the one before is taken, with a warning",
        tests: &[
            t(INTERRUPTIONS, "a_damaged_state_has_one_before_it", &[]),
            t("engine/src/fit/state.rs", "a_state_comes_back_and_a_damaged_one_does_not", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 60,
        input: "paths with spaces, not UTF-8, `~`, too long; time zones",
        must: "work; too long a name is told",
        tests: &[
            t(SURROUNDINGS, "any_path_is_a_path", &[]),
            t(SURROUNDINGS, "locale_and_time_zone_change_nothing", &[]),
        ],
        verdict: Partly("a clock that jumps is not tried; times are taken from a clock that does not"),
    },
    Row {
        number: 61,
        input: "no display",
        must: "69, names `vgs render`",
        tests: &[t("tools/cli/tests/view.rs", "without_a_display_it_names_another_way", &[])],
        verdict: Holds,
    },
    Row {
        number: 62,
        input: "windows that are resized, to nothing, minimised, of another scale",
        must: "goes on, the validation layers are silent",
        tests: &[
            t("tools/cli/tests/view.rs", "a_window_of_other_sizes_and_scales", &[]),
            t("engine/src/gpu/surface.rs", "the_surface_dictates_the_size_or_the_window_does", &[]),
            t("engine/src/gpu/surface.rs", "plain_formats_are_preferred", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 63,
        input: "no OpenXR runtime, a broken one",
        must: "69 with another way",
        tests: &[t("xr-app/tests/monado.rs", "without_a_runtime_the_help_names_a_way", &[])],
        verdict: Partly("no runtime; one without Vulkan, or of another GPU, is not tried"),
    },
    Row {
        number: 64,
        input: "the headset goes away",
        must: "made again, or an end with the work kept",
        tests: &[
            t("xr-app/tests/monado.rs", "a_runtime_that_dies_is_reported", &[]),
            t("xr-app/tests/simulated.rs", "a_stop_ends_the_session_by_the_headset", &[]),
        ],
        verdict: Partly("a runtime that dies or stops; a session or an instance that is lost is not tried"),
    },
    Row {
        number: 65,
        input: "tracking is lost",
        must: "the last pose, no NaN",
        tests: &[],
        verdict: Untested("no runtime here loses its tracking"),
    },
    Row {
        number: 66,
        input: "stdout closed, stderr full",
        must: "no panic, the exit code of the work",
        tests: &[
            t(WHOLE, "a_closed_stdout_is_no_panic", &[]),
            t(SURROUNDINGS, "a_full_or_closed_stderr_is_no_panic", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 67,
        input: "a fit that diverges",
        must: "told as such, with the last good splats",
        tests: &[
            t("engine/src/fit/run.rs", "a_state_that_is_no_fit_any_more_is_refused", &[]),
            t(FIT, "a_splat_that_is_not_a_number_is_contained", &[]),
        ],
        verdict: Partly("it ends with the splats before; a step is not repeated with smaller rates"),
    },
    Row {
        number: 68,
        input: "splats that collapse on the way",
        must: "clamped, and counted",
        tests: &[
            t("tests/tests/extremes/shape.rs", "n2_smaller_than_a_voxel", &[]),
            t("tests/tests/extremes/shape.rs", "n17_quaternions", &[]),
            t("tests/tests/properties.rs", "p6_extreme_parameters_stay_finite", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 69,
        input: "a DICOM folder of several series, doubled, with gaps; unknown packing",
        must: "2 with the series, told, 69 with a way",
        tests: &[
            t(DICOM, "one_series_of_several_is_chosen", &[]),
            t(DICOM, "slices_at_one_place_are_told_apart_or_refused", &[]),
            t(DICOM, "missing_and_uneven_slices_are_at_their_true_places", &[]),
            t(DICOM, "what_is_no_volume_is_refused_by_name", &["VGS-DCM-011"]),
        ],
        verdict: Holds,
    },
    Row {
        number: 70,
        input: "variables that cannot be read, a locale of decimal commas",
        must: "2; a number has a point",
        tests: &[
            t(SURROUNDINGS, "variables_that_cannot_be_read_are_told", &[]),
            t(SURROUNDINGS, "locale_and_time_zone_change_nothing", &[]),
        ],
        verdict: Holds,
    },
];

/// Faults that were found by trying, each with what keeps it from coming back.
pub const FOUND: &[Row] = &[
    Row {
        number: 0,
        input: "a change of topology, and the profile of the paper, panicked",
        must: "every combination runs",
        tests: &[
            t("tests/tests/options.rs", "no_profile_is_left_out", &[]),
            t("tests/tests/topology.rs", "every_way_keeps_to_its_limit_and_fits", &[]),
            t("tests/tests/profiles.rs", "every_profile_fits_a_phantom", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 1,
        input: "a lock file that is a link, or a file of the user's, was written over",
        must: "left alone, 73",
        tests: &[t("tools/cli/src/shared/lock.rs", "what_is_no_lock_is_left_alone", &[])],
        verdict: Holds,
    },
    Row {
        number: 2,
        input: "one splat at 1e11 mm took gigabytes, at 1e13 a panic",
        must: "cells are bounded",
        tests: &[
            t("engine/src/render/extents.rs", "one_splat_far_away_changes_nothing_for_the_others", &[]),
            t("engine/src/render/extents.rs", "cells_are_bounded_whatever_the_splats_are", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 3,
        input: "2 MB of an InVesalius project became 2.6 GB",
        must: "names are bounded before they are read",
        tests: &[t(
            "engine/src/volume/inv3.rs",
            "names_that_come_before_their_members_are_read_and_bounded",
            &[],
        )],
        verdict: Holds,
    },
    Row {
        number: 4,
        input: "a transfer function of 0.7 MB took 15 s",
        must: "time grows with the length",
        tests: &[t(
            "engine/src/transfer/file/slicer_xml.rs",
            "an_attribute_is_there_once_and_very_many_of_them_are_no_trouble",
            &[],
        )],
        verdict: Holds,
    },
    Row {
        number: 5,
        input: "a fit that failed replaced the finished one",
        must: "what was finished stays",
        tests: &[
            t(INTERRUPTIONS, "a_stopped_fit_leaves_a_finished_one_alone", &[]),
            t("tools/cli/tests/failing_writes.rs", "whatever_of_a_fit_the_disk_has_no_room_for", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 6,
        input: "no memory ended by a signal",
        must: "71",
        tests: &[
            t("engine/src/memory.rs", "what_is_too_much_is_refused_before_it_is_taken", &[]),
            t("tools/cli/tests/host_memory.rs", "without_memory_it_ends_with_its_exit_code", &[]),
        ],
        verdict: Partly("the program; lavapipe itself dies where it gets no memory"),
    },
    Row {
        number: 7,
        input: "`--splats` of 1e9 and more aborted",
        must: "2 with the most that there may be",
        tests: &[refused(&[
            "far too many splats",
            "more splats than can be counted",
            "a density beyond all",
        ])],
        verdict: Holds,
    },
    Row {
        number: 8,
        input: "splats with colours were drawn black",
        must: "in their colours, by themselves",
        tests: &[t("tests/tests/alpha.rs", "standard_splats_have_their_own_colours", &[])],
        verdict: Holds,
    },
    Row {
        number: 9,
        input: "`--time-budget` was passed without a word",
        must: "the first splats are placed within it; what cannot be kept is told",
        tests: &[
            t("engine/src/fit/init/tests/mod.rs", "after_the_deadline_splats_are_placed_at_random", &[]),
            t(WHOLE, "a_time_budget_is_kept", &[]),
            t(WHOLE, "a_time_budget_that_cannot_be_kept_is_told", &[]),
        ],
        verdict: Partly("it bounds placing and steps; reading and the evaluation at the end have no clock"),
    },
    Row {
        number: 10,
        input: "`--device 7` matched a version",
        must: "a number is a number",
        tests: &[t(
            "engine/src/gpu/choice.rs",
            "the_fastest_usable_device_is_chosen_unless_the_user_says_otherwise",
            &["7"],
        )],
        verdict: Holds,
    },
    Row {
        number: 11,
        input: "a volume one voxel wide had a mean of ∞ dB",
        must: "offsets without a sample do not count",
        tests: &[t(
            "engine/src/fit/evaluate.rs",
            "an_offset_without_a_sample_in_the_region_is_no_perfect_one",
            &[],
        )],
        verdict: Holds,
    },
    Row {
        number: 12,
        input: "temporary files of a killed run stayed",
        must: "the next run removes them",
        tests: &[t(OUTPUT, "what_a_killed_run_left_is_removed_and_nothing_else", &[])],
        verdict: Holds,
    },
    Row {
        number: 13,
        input: "unsorted points of a transfer function were taken",
        must: "65; a map from 0 to 1 is stretched, with a warning",
        tests: &[
            t("engine/src/transfer/file/tests.rs", "what_is_wrong_is_told", &[]),
            t("engine/src/transfer/file/tests.rs", "paraview_colour_maps", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 14,
        input: "comparing two small files of 16384² pixels took 4.9 GB",
        must: "what is needed is asked for first; measures work by bands",
        tests: &[
            t("engine/src/image/measure.rs", "ssim_is_what_its_definition_says", &[]),
            t("engine/src/image/flip.rs", "bands_are_as_good_as_the_whole", &[]),
            t("engine/src/image/image.rs", "sizes_are_checked", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 15,
        input: "a damaged state had none before it; settings were told one by one; a limit of file sizes killed",
        must: "each told, nothing lost",
        tests: &[
            t(INTERRUPTIONS, "a_damaged_state_has_one_before_it", &[]),
            t(INTERRUPTIONS, "a_limit_of_the_size_of_files_is_an_error", &[]),
            t("tools/cli/src/commands/fit/checkpoint.rs", "another_configuration_is_told_by_its_key", &[]),
            t("tools/cli/src/commands/fit/checkpoint.rs", "a_missing_state_is_told_as_a_missing_file", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 16,
        input: "messages that led nowhere",
        must: "a help with a way for each",
        tests: &[
            t(PLY, "a_compressed_ply_of_supersplat_is_told_by_its_name", &[]),
            t(
                "engine/src/splat/file.rs",
                "a_file_is_known_by_its_content_and_written_by_its_extension",
                &["a.spz"],
            ),
        ],
        verdict: Partly("of foreign splat files; not every message is held to it"),
    },
    Row {
        number: 17,
        input: "no check of licences and advisories",
        must: "part of continuous integration",
        tests: &[],
        verdict: Untested("CI has none yet"),
    },
];

/// What is tried with files that nobody thought of.
pub const ALL_READERS: &[Test] =
    &[t(FUZZ, "readers_survive_what_they_are_given", &[]), t(MEMORY, "memory_follows_what_is_read", &[])];
