//! What can change while a scene is viewed: the transfer function, clip planes, and how objects appear. On
//! the device it is tables of a few thousand rows, so a change costs nothing that grows with the scene.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::{DVec3, DVec4};
use shaders_glsl::types;

use base::error::{Error, Kind, Result};
use gpu::{Buffer, Gpu, Recorder, UploadRing};
use splat::{Object, SplatSet, usual_colours};
use transfer::{FixedTo, Light, MOST_FILL, Table, TransferFunction};

/// Greatest number of clip planes; a box takes six.
pub const PLANES: usize = shaders_glsl::look_row::CLIP_PLANES as usize;
/// Number of objects that can have an appearance: as many as a label can number.
const OBJECTS: usize = 256;

/// A clip plane in the world: points with normal · x < offset are cut away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClipPlane {
    /// Unit vector, RAS, towards the side that stays.
    pub normal: DVec3,
    /// Offset of the plane along the normal, mm RAS.
    pub offset: f64,
}

impl ClipPlane {
    /// Returns the planes that keep the box between two corners, mm RAS.
    pub fn around(low: DVec3, high: DVec3) -> [Self; 6] {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        std::array::from_fn(|i| {
            let axis = axes[i / 2];
            match i % 2 {
                0 => ClipPlane { normal: axis, offset: low.dot(axis) },
                _ => ClipPlane { normal: -axis, offset: -high.dot(axis) },
            }
        })
    }
}

/// Way in which a transfer function is applied along a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Classification {
    /// The function is looked up at the samples.
    Point,
    /// The function is integrated between samples (Engel, Kraus, Ertl 2001), for functions that change faster
    /// than the samples follow.
    PreIntegrated,
}

/// Appearance of an object of a scene, one part of [`Look`]. An object is the splats of one label
/// ([`splat::Object`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Appearance {
    /// True if its splats are shown. Where others overlapped them, these fill the gap.
    pub visible: bool,
    /// A display-referred colour, 0 to 1, in place of the transfer function's; it is lit alike.
    pub tint: Option<[f32; 3]>,
    /// Factor of the opacity per mm, 0 to 1. At 0 nothing of the object is seen, but it holds its place in
    /// the field.
    pub opacity: f32,
}

impl Default for Appearance {
    /// Returns an appearance that leaves the transfer function's result unchanged.
    fn default() -> Self {
        Appearance { visible: true, tint: None, opacity: 1.0 }
    }
}

impl Appearance {
    /// Returns true if the object is hidden or looks as the transfer function alone makes it look.
    fn is_plain(&self) -> bool {
        !self.visible || self.tint.is_none() && self.opacity >= 1.0
    }

    /// Returns the row of the device's table, with a number of its transfer function. Numbers out of range are
    /// clamped; NaN becomes 0.
    fn row(&self, function: u32) -> types::Appearance {
        let unit = |v: f32| if v > 0.0 { v.min(1.0) } else { 0.0 };
        let tint = self.tint.map_or([0.0; 4], |[r, g, b]| [unit(r), unit(g), unit(b), 1.0]);
        types::Appearance { tint, opacity: unit(self.opacity), visible: u32::from(self.visible), function }
    }
}

/// The look of a scene: its transfer function, light, clip planes and appearances of objects.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// Transfer function from intensity to colour and opacity per mm, with the material of shaded surfaces.
    pub transfer: TransferFunction,
    /// Clip planes; everything beyond one of them is cut away.
    pub clip: Vec<ClipPlane>,
    /// Appearances of objects, by their number; an object that is not listed has the default one. They apply
    /// to splats only: modes of a volume show all of it.
    pub objects: BTreeMap<u8, Appearance>,
    /// Transfer functions of objects of their own, by their number, in place of that of the scene; their material
    /// does not count. Mode decoded alone shows them ([`super::ModeRow::own_functions`]).
    pub functions: BTreeMap<u8, TransferFunction>,
    /// Where the light of shaded surfaces comes from.
    pub light: Light,
}

impl Look {
    /// Creates a look with a transfer function, no clip planes, default appearances and the first light.
    pub fn new(transfer: TransferFunction) -> Self {
        Look {
            transfer,
            clip: Vec::new(),
            objects: BTreeMap::new(),
            functions: BTreeMap::new(),
            light: Light::default(),
        }
    }

    /// Returns how the transfer function should be applied. Point sampling is enough if opacity changes by
    /// little over the distance that the intensity moves between samples; a ramp over less than 60 HU needs
    /// integration.
    pub fn classification(&self) -> Classification {
        let narrow = self.all_functions().any(|function| {
            let mut ramps = function.opacities().windows(2);
            ramps.any(|p| {
                (p[1].opacity - p[0].opacity).abs() > 0.02 && p[1].intensity - p[0].intensity < NARROW
            })
        });
        if narrow { Classification::PreIntegrated } else { Classification::Point }
    }

    /// Returns true if the opacity of some function depends on the gradient.
    pub fn depends_on_gradient(&self) -> bool {
        self.all_functions().any(TransferFunction::depends_on_gradient)
    }

    /// Returns the function of the scene and those of objects.
    fn all_functions(&self) -> impl Iterator<Item = &TransferFunction> {
        std::iter::once(&self.transfer).chain(self.functions.values())
    }

    /// Returns the transfer function of an object.
    pub fn function_of(&self, number: u8) -> &TransferFunction {
        self.functions.get(&number).unwrap_or(&self.transfer)
    }

    /// Gives each object a colour of its own: the one that is usual for its name, or the next of a few that are easily
    /// told apart.
    pub fn tint_objects(&mut self, objects: &[Object]) {
        let colours = usual_colours(objects.iter().map(|object| object.name.as_str()));
        for (object, colour) in objects.iter().zip(colours) {
            self.objects.entry(object.number).or_default().tint = Some(colour);
        }
    }

    /// Returns the rows of `set` whose objects are shown, and whose means no clip plane cuts away.
    pub fn shown(&self, set: &SplatSet) -> Vec<usize> {
        let visible = |i: &usize| {
            let label = set.labels.as_ref().map_or(0, |labels| labels[*i]);
            let mean = DVec3::from_array(set.splats[*i].mean.map(f64::from)) + set.origin_mm;
            self.shows(label, mean)
        };
        (0..set.splats.len()).filter(visible).collect()
    }

    /// Returns true if the object of this number is shown, and no clip plane cuts away this point, mm RAS.
    pub fn shows(&self, number: u8, at_mm: DVec3) -> bool {
        self.objects.get(&number).is_none_or(|own| own.visible)
            && self.clip.iter().all(|plane| plane.normal.dot(at_mm) >= plane.offset)
    }

    /// Returns the splats of a set that it shows: without hidden objects and what its clip planes cut away.
    pub fn shown_part(&self, set: &SplatSet) -> SplatSet {
        let part = set.part(|number, at| self.shows(number, at));
        if part.count() == set.count() { set.clone() } else { part }
    }

    /// Returns v₀ of the shaded gradient: the lower end of what some function shows of intensities in `range`.
    pub fn dark(&self, range: [f64; 2]) -> f64 {
        let of = |function: &TransferFunction| {
            let [low, high] = function.visible().unwrap_or(range);
            if low.is_finite() { low } else { range[0].min(high) }
        };
        self.functions.values().map(of).fold(of(&self.transfer), f64::min)
    }
}

/// A ramp of opacity over less than this, HU, is narrow.
const NARROW: f64 = 60.0;

/// Number of looks that were created so far.
static LOOKS: AtomicU64 = AtomicU64::new(0);

/// Pieces of host memory through which looks reach the device: more than there are frames in flight.
pub(super) const PIECES: usize = 4;

/// What is told of a look without its tables.
#[derive(Clone, Debug, Default)]
pub struct LookFacts {
    /// v₀ of the gradient.
    pub dark: f64,
    /// What the appearance of each object leaves of its O, by its number.
    pub shown: Vec<f32>,
    /// True if surfaces are lit.
    pub shaded: bool,
    /// True if their light knows what is around them: if there is ambient occlusion.
    pub occluded: bool,
    /// True if the opacity of some function depends on the gradient.
    pub graded: bool,
    /// True if some object has a tint or an opacity; otherwise kernels need not look for them.
    pub objects_differ: bool,
    /// True if some object is hidden.
    pub hides: bool,
    /// True if some object has a transfer function of its own.
    pub own_functions: bool,
}

/// A look as the device gets it.
struct LookTables {
    facts: LookFacts,
    rows: Vec<types::Look>,
    points: Vec<[u32; 2]>,
    integrals: Vec<[u32; 4]>,
    visible: Vec<u32>,
    gradient_factors: Vec<f32>,
    appearances: Vec<types::Appearance>,
}

impl LookTables {
    fn new(look: &Look, range: [f64; 2], origin: DVec3) -> Result<Self> {
        if look.clip.len() > PLANES {
            return Err(Error::new(
                Kind::Usage,
                "VGS-LOOK-001",
                format!("{} clip planes; there can be {PLANES}", look.clip.len()),
            )
            .help("a box takes six planes"));
        }
        // That of the scene, then each other one once.
        let mut functions = vec![&look.transfer];
        let mut function_of = [0; OBJECTS];
        for (&number, function) in &look.functions {
            let known = functions.iter().position(|other| *other == function);
            let at = known.unwrap_or(functions.len());
            if known.is_none() {
                functions.push(function);
            }
            function_of[usize::from(number)] = at as u32;
        }
        let tables: Vec<Table> = functions.iter().map(|function| Table::new(function, range)).collect();
        let mut planes = [[0.0; 4]; PLANES];
        for (to, plane) in planes.iter_mut().zip(&look.clip) {
            let row: DVec4 = plane.normal.extend(plane.normal.dot(origin) - plane.offset);
            *to = row.as_vec4().to_array();
        }
        let appearances: Vec<types::Appearance> = (0..OBJECTS)
            .map(|number| {
                let appearance = look.objects.get(&(number as u8)).copied().unwrap_or_default();
                appearance.row(function_of[number])
            })
            .collect();
        let material = look.transfer.material;
        let dark = look.dark(range);
        let (towards, turns) = match look.light.fixed_to {
            // In eye space z goes away from the viewer.
            FixedTo::Camera => (look.light.direction() * DVec3::new(1.0, 1.0, -1.0), 0),
            FixedTo::Patient => (look.light.direction(), 1),
        };
        let mut offset = 0;
        let row = |table: &Table| types::Look {
            first: table.first as f32,
            inverse_step: (1.0 / table.step) as f32,
            last: (table.len() - 1) as f32,
            integral_unit: table.integral_unit as f32,
            dark: dark as f32,
            ambient: material.ambient as f32,
            diffuse: material.diffuse as f32,
            specular: material.specular as f32,
            power: material.power as f32,
            occlusion: material.occlusion as f32,
            inverse_gradient_step: (1.0 / table.gradient_step) as f32,
            plane_count: look.clip.len() as u32,
            offset: 0,
            light: towards.as_vec3().to_array(),
            fill: look.light.fill.clamp(0.0, MOST_FILL) as f32,
            light_turns: turns,
            planes,
        };
        let rows: Vec<types::Look> = tables
            .iter()
            .map(|table| {
                let row = types::Look { offset, ..row(table) };
                offset += table.len() as u32;
                row
            })
            .collect();
        Ok(LookTables {
            facts: LookFacts {
                dark,
                shown: appearances.iter().map(|object| object.opacity * object.visible as f32).collect(),
                shaded: material.shade,
                occluded: material.shade && material.occlusion > 0.0,
                graded: look.depends_on_gradient(),
                objects_differ: !look.objects.values().all(Appearance::is_plain),
                hides: look.objects.values().any(|object| !object.visible),
                own_functions: tables.len() > 1,
            },
            rows,
            points: tables.iter().flat_map(|t| t.points.iter().map(|&p| packed(p))).collect(),
            integrals: tables.iter().flat_map(|t| t.integrals.iter().copied()).collect(),
            visible: visible_before(&tables),
            gradient_factors: tables.iter().flat_map(|t| t.gradient_factors.iter().copied()).collect(),
            appearances,
        })
    }
}

/// A look on the device. Its buffers are written in place: what is submitted reads the look that was set last before.
pub struct LookBuffers {
    /// Number of the look, different for every one.
    pub number: u64,
    /// What is told of the look without its tables.
    pub facts: LookFacts,
    /// Parameters of the look, one row for each function.
    pub rows: Buffer<types::Look>,
    /// Colour and extinction of each entry, packed.
    pub points: Buffer<[u32; 2]>,
    /// Integrals of colour and extinction over the table.
    pub integrals: Buffer<[u32; 4]>,
    /// For each entry of the table the number of visible entries before it; one more than there are entries.
    pub visible: Buffer<u32>,
    /// Factors of the opacity over the gradient magnitude, a table for each function.
    pub gradient_factors: Buffer<f32>,
    /// Appearance of each object, by its number.
    pub appearances: Buffer<types::Appearance>,
    gpu: Gpu,
    range: [f64; 2],
    origin: DVec3,
    ring: UploadRing,
}

impl LookBuffers {
    /// Uploads the look of a scene whose intensities lie in `range` and whose origin is at `origin` in the
    /// world, mm RAS.
    pub fn new(gpu: &Gpu, look: &Look, range: [f64; 2], origin: DVec3) -> Result<Self> {
        let mut buffers = Self::with_room(gpu, &LookTables::new(look, range, origin)?, range, origin)?;
        buffers.set(look, |_, _| ())?;
        Ok(buffers)
    }

    /// Creates buffers for as many functions as `tables` have, each over the whole range.
    fn with_room(gpu: &Gpu, tables: &LookTables, range: [f64; 2], origin: DVec3) -> Result<Self> {
        const PURPOSE: &str = "transfer function";
        let (functions, entries) = (tables.rows.len(), Table::most_entries(range));
        let rows = gpu.buffer("look", PURPOSE, functions)?;
        let points = gpu.buffer("transfer function", PURPOSE, functions * entries)?;
        let integrals = gpu.buffer("integrals of the transfer function", PURPOSE, functions * entries)?;
        let visible = gpu.buffer("visible entries", PURPOSE, entries + 1)?;
        let gradient_factors = gpu.buffer("gradient opacities", PURPOSE, tables.gradient_factors.len())?;
        let appearances = gpu.buffer("appearances of objects", PURPOSE, OBJECTS)?;
        let bytes = [rows.bytes(), points.bytes(), integrals.bytes(), visible.bytes()].iter().sum::<u64>()
            + gradient_factors.bytes()
            + appearances.bytes();
        Ok(LookBuffers {
            number: 0,
            facts: LookFacts::default(),
            rows,
            points,
            integrals,
            visible,
            gradient_factors,
            appearances,
            gpu: gpu.clone(),
            range,
            origin,
            ring: UploadRing::new(gpu, "looks on their way", PIECES, bytes as usize)?,
        })
    }

    /// Changes the look, in one submission with what `also` records after it. Waits for nothing, and allocates only if
    /// more functions are shown than ever before.
    pub fn set(&mut self, look: &Look, also: impl FnOnce(&mut Recorder, &Self)) -> Result<()> {
        let tables = LookTables::new(look, self.range, self.origin)?;
        if tables.rows.len() > self.rows.len() {
            *self = Self::with_room(&self.gpu, &tables, self.range, self.origin)?;
        }
        let mut recorder = self.gpu.record()?;
        self.ring.begin()?;
        self.ring.write(&mut recorder, &tables.rows, &mut self.rows)?;
        self.ring.write(&mut recorder, &tables.points, &mut self.points)?;
        self.ring.write(&mut recorder, &tables.integrals, &mut self.integrals)?;
        self.ring.write(&mut recorder, &tables.visible, &mut self.visible)?;
        self.ring.write(&mut recorder, &tables.gradient_factors, &mut self.gradient_factors)?;
        self.ring.write(&mut recorder, &tables.appearances, &mut self.appearances)?;
        self.number = LOOKS.fetch_add(1, Ordering::Relaxed);
        self.facts = tables.facts;
        also(&mut recorder, self);
        recorder.submit()?;
        Ok(())
    }
}

/// Returns for each entry of the first table the number of entries before it at which a function shows something,
/// and at last the number of all. Another function counts as visible at an entry if it is within two entries of it.
fn visible_before(tables: &[Table]) -> Vec<u32> {
    let first = &tables[0];
    let mut visible: Vec<bool> = first.points.iter().map(|point| point[3] > 0.0).collect();
    let last = visible.len() as i64 - 1;
    for table in &tables[1..] {
        let shown = (0..table.len()).filter(|&i| table.points[i][3] > 0.0);
        for i in shown {
            // The entry holds half a step on both sides; the ends hold all that is beyond.
            let (low, high) = (i as f64 - 1.0, i as f64 + 1.0);
            let low = if i == 0 { f64::NEG_INFINITY } else { low };
            let high = if i + 1 == table.len() { f64::INFINITY } else { high };
            let entry = |i: f64| (table.first + i * table.step - first.first) / first.step;
            let from = (entry(low).floor() as i64).saturating_sub(1).clamp(0, last);
            let to = (entry(high).ceil() as i64).saturating_add(1).clamp(0, last);
            visible[from as usize..=to as usize].fill(true);
        }
    }
    let mut before = vec![0];
    for is_visible in visible {
        before.push(before[before.len() - 1] + u32::from(is_visible));
    }
    before
}

/// Returns the colour in three 16-bit fractions and the extinction as a half: 8 bytes a lookup.
fn packed([r, g, b, extinction]: [f32; 4]) -> [u32; 2] {
    let fraction = |v: f32| (v.clamp(0.0, 1.0) * 65535.0).round() as u32;
    let half = u32::from(half::f16::from_f32(extinction).to_bits());
    [fraction(r) | fraction(g) << 16, fraction(b) | half << 16]
}
