use engine::gpu::*; use engine::render::*; use engine::image::{self, Image}; use engine::splat; use engine::transfer;
fn cpu() -> f64 { let s = std::fs::read_to_string("/proc/self/stat").unwrap(); let f: Vec<&str> = s.rsplit(')').next().unwrap().split_whitespace().collect(); (f[11].parse::<f64>().unwrap() + f[12].parse::<f64>().unwrap()) * 10.0 }
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let gpu = Gpu::new(&GpuOptions { validation: std::env::var("VAL").is_ok(), ..Default::default() }).unwrap();
    let set = splat::read(a[1].as_ref(), &Default::default()).unwrap();
    let n: u32 = std::env::var("SIZE").ok().and_then(|s| s.parse().ok()).unwrap_or(512);
    for tf in a[2].split(',') {
        let mut t = transfer::preset(tf).unwrap().over([-1024.0, 3071.0]);
        if std::env::var("SHADE").is_ok() { t.material.shade = true; } else { t.material.shade = false; }
        let look = Look::new(t);
        let scene = Scene::new(&gpu, Some(&set), None, &look).unwrap();
        let c = scene.cloud.as_ref().unwrap();
        let [lo, hi] = scene.bounds();
        let cam = Camera::from_side("anterior-left", (lo + hi) * 0.5, (hi - lo).length() * 0.4, 30.0, 1.0).unwrap();
        println!("{tf}: {} splats, sigma {} mm, active {}", c.count, c.sigma_mm, c.active_count().unwrap());
        let mut reference: Option<Image> = None;
        for spec in a[3].split(',') {
            let (m, step) = spec.split_once(':').unwrap_or((spec, "1"));
            let class = if step.ends_with('p') { Some(Classification::PreIntegrated) } else { Some(Classification::Point) };
            let settings = Settings { precise: true, depth: false, step: step.trim_end_matches('p').parse().unwrap(), classification: class, ..Settings::new([n, n]) };
            let mut r = Renderer::new(&gpu, mode(m).unwrap(), &scene, &settings).unwrap();
            r.render(&scene, &[cam]).unwrap();
            gpu.take_profile();
            let frames = if m == "exact" { 1 } else { 3 };
            let (w, t0) = (std::time::Instant::now(), cpu());
            for _ in 0..frames { r.render(&scene, &[cam]).unwrap(); }
            let (wall, cpu) = (w.elapsed().as_secs_f64() * 1e3 / frames as f64, (cpu() - t0) / frames as f64);
            let img = Image { size: [n as usize; 2], pixels: r.target.read_colour(0).unwrap() };
            let (p, s) = match &reference { Some(x) => (image::psnr(x, &img).unwrap(), image::ssim(x, &img).unwrap()), None => (0.0, 0.0) };
            println!("  {spec}: {wall:.0} ms wall {cpu:.0} core-ms; {p:.2} dB ssim {s:.4}");
            for (name, t) in gpu.take_profile().iter().take(5) { print!("    {name} {:.1}", t.total_ms / frames as f64); }
            println!();
            if reference.is_none() { reference = Some(img.clone()); }
            if let Ok(dir) = std::env::var("OUT") { image::write(format!("{dir}/{tf}-{}.png", spec.replace(":", "-")), &img, None, &image::WriteOptions { background: Some([0.0;3]), force: true, ..Default::default() }).unwrap(); }
        }
    }
    for m in gpu.validation_messages().iter().take(5) { println!("{m}"); }
}
