//! Every profile as a fit.

use engine::fit::{PROFILES, Profile};
use vgs_tests::Device;
use vgs_tests::fitting::Case;

#[test]
fn every_profile_fits_a_phantom() {
    let gpu = Device::boot();
    for Profile { name, .. } in PROFILES {
        let mut case = Case::phantom([28, 26, 30], 24);
        let config = Profile::named(name).and_then(Profile::config).expect(name);
        case.config = config.with(|c| {
            c.iterations = 24;
            c.count.splats = 150;
            c.topology.every = 8;
        });
        if case.config.topology.name != "none" {
            case.config.topology.from = 8;
        }
        let mut fitter = case.fitter(&gpu, &case.start());
        case.run(&mut fitter, 1);
        let first = fitter.progress().expect("progress");
        case.run(&mut fitter, 24);
        let last = fitter.progress().expect("progress");
        let count = fitter.splats().expect("splats").len();
        println!("{name}: {:.2} to {:.2} dB, {count} splats", first.psnr_db, last.psnr_db);
        assert!(last.psnr_db > first.psnr_db, "{name}: {} after {}", last.psnr_db, first.psnr_db);
        let most = (150.0 * f64::from(case.config.topology.limit)) as usize;
        assert!((150..=most).contains(&count), "{name}: {count} splats");
        assert_eq!(fitter.frozen().expect("a count"), 0, "{name}");
    }
}
