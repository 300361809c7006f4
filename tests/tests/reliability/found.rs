//! Faults that were found by trying, and the tests that keep them away.

use super::named::{INTERRUPTIONS, OUTPUT, PLY, WHOLE, refused};
use super::{Row, Verdict::*, t};

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
            t("engine/render/src/extents.rs", "one_splat_far_away_changes_nothing_for_the_others", &[]),
            t("engine/render/src/extents.rs", "cells_are_bounded_whatever_the_splats_are", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 3,
        input: "2 MB of an InVesalius project became 2.6 GB",
        must: "names are bounded before they are read",
        tests: &[t(
            "engine/volume/src/inv3.rs",
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
            "engine/transfer/src/file/slicer_xml.rs",
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
            t("engine/base/src/memory.rs", "what_is_too_much_is_refused_before_it_is_taken", &[]),
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
            t("engine/fit/src/init/tests/mod.rs", "after_the_deadline_splats_are_placed_at_random", &[]),
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
            "engine/gpu/src/choice.rs",
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
            "engine/fit/src/evaluate.rs",
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
            t("engine/transfer/src/file/tests.rs", "what_is_wrong_is_told", &[]),
            t("engine/transfer/src/file/tests.rs", "paraview_colour_maps", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 14,
        input: "comparing two small files of 16384² pixels took 4.9 GB",
        must: "what is needed is asked for first; measures work by bands",
        tests: &[
            t("engine/image/src/measure.rs", "ssim_is_what_its_definition_says", &[]),
            t("engine/image/src/flip.rs", "bands_are_as_good_as_the_whole", &[]),
            t("engine/image/src/image.rs", "sizes_are_checked", &[]),
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
                "engine/splat/src/file.rs",
                "a_file_is_known_by_its_content_and_written_by_its_extension",
                &["a.splat"],
            ),
        ],
        verdict: Partly("of foreign splat files; not every message is held to it"),
    },
    Row {
        number: 17,
        input: "no check of licences and advisories",
        must: "part of continuous integration",
        tests: &[],
        verdict: Untested("not by a test of the suite; tools/test runs tools/dependencies beside them"),
    },
    Row {
        number: 18,
        input: "an intercept of \"-1024,0\" counted as 0",
        must: "read with a warning, or refused with the element",
        tests: &[
            t(
                "engine/volume/src/dicom/tests/values.rs",
                "an_intercept_is_read_or_refused_by_name_however_it_is_written",
                &[],
            ),
            t(
                "engine/volume/src/dicom/tests/elements.rs",
                "what_cannot_be_read_is_an_error_and_no_default",
                &[],
            ),
        ],
        verdict: Holds,
    },
    Row {
        number: 19,
        input: "a Modality LUT was ignored",
        must: "applied, or refused by name",
        tests: &[t(
            "engine/volume/src/dicom/tests/values.rs",
            "a_table_takes_the_place_of_slope_and_intercept",
            &[],
        )],
        verdict: Holds,
    },
    Row {
        number: 20,
        input: "elements of representation UN were taken for numbers",
        must: "by the dictionary",
        tests: &[t("engine/volume/src/dicom/tests/elements.rs", "elements_are_taken_by_the_dictionary", &[])],
        verdict: Holds,
    },
    Row {
        number: 21,
        input: "of two structures of one name, or that differ in case only, the other one was taken",
        must: "the exact name first; of equals all",
        tests: &[t("engine/volume/src/dicom/tests/structures.rs", "structures_of_one_name", &[])],
        verdict: Holds,
    },
    Row {
        number: 22,
        input: "contours that overlap were a hole, XOR was an open line",
        must: "a union; a ring",
        tests: &[t(
            "engine/volume/src/dicom/tests/structures.rs",
            "contours_are_a_union_less_the_holes_and_by_parity_if_they_say_so",
            &[],
        )],
        verdict: Holds,
    },
    Row {
        number: 23,
        input: "frames of a segmentation that lie apart were as thick as the gap",
        must: "the planes of the scan",
        tests: &[t(
            "engine/volume/src/dicom/tests/structures.rs",
            "segments_far_apart_lie_on_the_planes_of_the_scan",
            &[],
        )],
        verdict: Holds,
    },
    Row {
        number: 24,
        input: "a slice scanned twice, or phases, were as many series as slices",
        must: "one series with a note; a series a phase",
        tests: &[
            t("engine/volume/src/dicom/tests/phases.rs", "a_slice_that_was_scanned_twice_is_one", &[]),
            t("engine/volume/src/dicom/tests/phases.rs", "a_phase_is_a_series", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 25,
        input: "a mosaic was one flat slice",
        must: "refused by name",
        tests: &[t(
            "engine/volume/src/dicom/tests/values.rs",
            "what_the_standard_does_not_allow_is_refused_by_name",
            &[],
        )],
        verdict: Holds,
    },
    Row {
        number: 26,
        input: "ParaView's hues went the other way round",
        must: "along the hue",
        tests: &[t(
            "engine/transfer/src/file/tests.rs",
            "hues_go_along_the_numbers_unless_the_map_wraps_them",
            &[],
        )],
        verdict: Holds,
    },
    Row {
        number: 27,
        input: "a pipe without a writer was waited for",
        must: "65 at once",
        tests: &[
            t("engine/base/src/input.rs", "pipes_sockets_and_devices_are_refused_at_once", &[]),
            t("tools/cli/tests/surroundings.rs", "a_pipe_as_input_is_refused_at_once", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 28,
        input: "a slice a little off its place refused a series; half a concatenation was a volume; slices without a scale were read raw",
        must: "taken with a note; refused by name",
        tests: &[
            t("engine/volume/src/dicom/tests/values.rs", "a_slice_a_little_off_its_place_is_taken", &[]),
            t("engine/volume/src/dicom/tests/values.rs", "half_a_concatenation_is_no_volume", &[]),
            t(
                "engine/volume/src/dicom/tests/values.rs",
                "slices_with_and_without_a_scale_are_no_volume",
                &[],
            ),
            t("engine/volume/src/dicom/tests/values.rs", "the_beginning_of_a_file_may_be_missing", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 29,
        input: "a CT without air had no HU",
        must: "recognised, or asked about",
        tests: &[
            t("engine/volume/src/kind_of_scan.rs", "values_tell_a_ct_also_without_air", &[]),
            t("tools/cli/tests/whole.rs", "a_ct_without_air_is_told_or_asked_about", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 30,
        input: "an opaque splat of 8 bits was dropped; one far from all others made the picture black",
        must: "opaque; framed without it, and told",
        tests: &[
            t("engine/splat/src/ply/tests/unusual.rs", "an_opaque_splat_of_8_bits_is_opaque", &[]),
            t("engine/splat/src/far.rs", "one_of_thirty_is_far_and_the_ends_of_a_leg_are_not", &[]),
        ],
        verdict: Holds,
    },
    Row {
        number: 31,
        input: "side files of two outputs of one name were the same",
        must: "each output has its own",
        tests: &[t("tools/cli/src/shared/outputs.rs", "side_files_belong_to_one_output", &[])],
        verdict: Holds,
    },
    Row {
        number: 32,
        input: "help to a full disk ended with 0",
        must: "74",
        tests: &[t("tools/cli/tests/surroundings.rs", "a_full_stdout_is_told_by_help_and_version_too", &[])],
        verdict: Holds,
    },
];
