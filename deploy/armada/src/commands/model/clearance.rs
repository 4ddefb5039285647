//! `armada model clearance`.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use armada_model::{
    Accuracy, BodyId, CollisionScene, Mount, Owner, PairDistance, Pose, RobotModel, SceneBuilder,
    Srdf, read_stl,
};
use clap::Args;
use nalgebra::Point3;
use serde::Serialize;

use super::file::FileArgs;
use super::input::one_stdin;
use super::joints::{JointsArgs, outside_limits};
use crate::exit::{Exit, UsageError};
use crate::output::{self, Output};
use crate::table::Table;

/// Arguments of `armada model clearance`.
#[derive(Args, Debug)]
#[command(after_help = AFTER_HELP)]
pub(super) struct ClearanceArgs {
    #[command(flatten)]
    file: FileArgs,
    /// SRDF that says which links may touch
    #[arg(value_name = "FILE.srdf")]
    srdf: Option<String>,
    #[command(flatten)]
    joints: JointsArgs,
    /// List all pairs that are nearer than this, in metres
    #[arg(long, value_name = "M")]
    below: Option<f64>,
    /// Folder in which meshes are looked for: package://NAME/FILE as NAME/FILE or FILE, others
    /// relative to it; binary and text STL
    #[arg(long, value_name = "FOLDER")]
    meshes: Option<PathBuf>,
}

const AFTER_HELP: &str = "Examples:
  armada model clearance arm.urdf --joints '[0, -1.2, 1.9, 0, 1.5, 0]'
  armada model clearance arm.urdf arm.srdf --joints @ready.json --below 0.05 --json
  armada model clearance arm.urdf --meshes ~/robots/arm_description

Distances within the robot between its <collision> shapes, of a mesh between convex hulls; and
between the capsules around them, which are never above that. Links that one joint connects, and
those that the SRDF disables, are not checked. Exit code 0 also for a robot that touches itself.

With --json, one line: {\"robot\": NAME, \"pairs_checked\": NUMBER, \"minimum\" and
\"minimum_capsules\": null or {\"a\", \"b\": LINK, \"distance_m\", \"point_a\", \"point_b\": [3] in the
root, \"accuracy\": \"shapes\" or \"capsules\"}, \"below_m\": NUMBER or null, \"below\": [as minimum],
\"without_shape\": [{\"link\", \"file\"}], \"warnings\": [TEXT]}. Links of without_shape are not checked.";

#[derive(Debug, Serialize)]
struct Answer<'m> {
    robot: &'m str,
    pairs_checked: usize,
    minimum: Option<Near<'m>>,
    minimum_capsules: Option<Near<'m>>,
    below_m: Option<f64>,
    below: Vec<Near<'m>>,
    without_shape: Vec<Without<'m>>,
    warnings: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Near<'m> {
    a: &'m str,
    b: &'m str,
    distance_m: f64,
    point_a: [f64; 3],
    point_b: [f64; 3],
    accuracy: &'static str,
}

#[derive(Debug, Serialize)]
struct Without<'m> {
    link: &'m str,
    file: String,
}

/// Prints how near the robot's links are to each other.
pub(super) fn run(args: &ClearanceArgs) -> anyhow::Result<Exit> {
    let joints = args.joints.joints.as_deref();
    one_stdin(&[Some(&args.file.file), joints, args.srdf.as_deref()])?;
    if let Some(below) = args.below.filter(|below| !below.is_finite()) {
        return Err(UsageError(format!("--below: {below} is not a finite number")).into());
    }
    let model = args.file.model()?;
    let positions = args.joints.positions(&model)?;
    let (scene, mut warnings) = scene(args, &model)?;
    warnings.extend(outside_limits(&model, &positions));
    let mut answer = measure(&model, &scene, &positions, args.below)?;
    for warning in &warnings {
        output::note(format_args!("warning: {warning}"));
    }
    answer.warnings = warnings;
    let out = Output::new(args.file.json);
    if out.is_json() {
        out.json_line(&answer)?;
    } else {
        print(&answer, &out)?;
    }
    Ok(Exit::Success)
}

/// The robot alone, and what is doubtful about its files.
fn scene(
    args: &ClearanceArgs,
    model: &RobotModel,
) -> anyhow::Result<(CollisionScene, Vec<String>)> {
    let warnings = RefCell::new(Vec::new());
    let mut mesh = |file: &str| {
        let folder = args.meshes.as_deref()?;
        vertices(folder, file).map_err(|error| warnings.borrow_mut().push(error)).ok()
    };
    let mut builder = SceneBuilder::new();
    let robot = builder.add_robot(model.name(), model, Mount::World(Pose::default()), &mut mesh)?;
    let mut warnings = warnings.into_inner();
    warnings.dedup();
    if let Some(file) = &args.srdf {
        let (srdf, problems) = read_srdf(file, model)?;
        warnings.extend(problems.iter().map(ToString::to_string));
        builder.apply_srdf(robot, &srdf)?;
    }
    Ok((builder.build(), warnings))
}

fn read_srdf(
    file: &str,
    model: &RobotModel,
) -> anyhow::Result<(Srdf, Vec<armada_model::SrdfProblem>)> {
    let text = super::srdf::text_of(file)?;
    Ok(Srdf::read(&text, super::srdf::label(file), model)?)
}

/// Vertices of a mesh, or why there are none.
fn vertices(folder: &Path, file: &str) -> Result<Vec<Point3<f64>>, String> {
    let places = places(folder, file);
    let is_stl = |place: &Path| {
        place.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("stl"))
    };
    let Some(place) = places.iter().find(|place| place.is_file()) else {
        let tried: Vec<_> = places.iter().map(|place| place.display().to_string()).collect();
        return Err(format!("mesh {file:?} is not there; looked for {}", tried.join(", ")));
    };
    if !is_stl(place) {
        return Err(format!("mesh {file:?} is no .stl file and is left out"));
    }
    let bytes = std::fs::read(place).map_err(|error| format!("{}: {error}", place.display()))?;
    read_stl(&bytes).map_err(|error| format!("{}: {error}", place.display()))
}

/// Where a mesh may be.
fn places(folder: &Path, file: &str) -> Vec<PathBuf> {
    if let Some(rest) = file.strip_prefix("package://") {
        let inside = rest.split_once('/').map(|(_, inside)| folder.join(inside));
        return std::iter::once(folder.join(rest)).chain(inside).collect();
    }
    vec![folder.join(file.strip_prefix("file://").unwrap_or(file))]
}

fn measure<'m>(
    model: &'m RobotModel,
    scene: &CollisionScene,
    positions: &[f64],
    below: Option<f64>,
) -> anyhow::Result<Answer<'m>> {
    let mut workspace = scene.workspace();
    let mut placed = scene.place(positions, &mut workspace)?;
    let near = |pair: &PairDistance| Near::of(model, scene, pair);
    let mut found = Vec::new();
    if let Some(below) = below {
        placed.pairs_below(below, Accuracy::Shapes, |pair| found.push(near(&pair)));
    }
    found.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m).then(a.a.cmp(b.a)));
    let link = |link: usize| model.links().get(link).map_or("", |link| link.name.as_str());
    let without = scene.without_shape().iter();
    Ok(Answer {
        robot: model.name(),
        pairs_checked: scene.pair_count(),
        minimum: placed.minimum(Accuracy::Shapes).as_ref().map(near),
        minimum_capsules: placed.minimum(Accuracy::Capsules).as_ref().map(near),
        below_m: below,
        below: found,
        without_shape: without
            .map(|missing| Without { link: link(missing.link), file: missing.file.clone() })
            .collect(),
        warnings: Vec::new(),
    })
}

impl<'m> Near<'m> {
    fn of(model: &'m RobotModel, scene: &CollisionScene, pair: &PairDistance) -> Self {
        let name = |body: BodyId| match scene.body(body).map(|body| body.owner()) {
            Some(Owner::Link { link, .. }) => {
                model.links().get(link).map_or("", |link| link.name.as_str())
            }
            Some(Owner::Fixed { .. }) | None => "",
        };
        Self {
            a: name(pair.a),
            b: name(pair.b),
            distance_m: pair.distance_m,
            point_a: pair.point_a.coords.into(),
            point_b: pair.point_b.coords.into(),
            accuracy: match pair.accuracy {
                Accuracy::Shapes => "shapes",
                Accuracy::Capsules => "capsules",
            },
        }
    }
}

fn print(answer: &Answer<'_>, out: &Output) -> anyhow::Result<()> {
    out.line(format_args!("{}: {} pairs checked", answer.robot, answer.pairs_checked))?;
    let mut table = Table::new(&["", "link", "link", "distance [m]", "at", "and"]);
    let point = |[x, y, z]: [f64; 3]| format!("({x:.4}, {y:.4}, {z:.4})");
    let mut row = |what: &str, near: &Near<'_>| {
        table.row(vec![
            what.to_owned(),
            near.a.to_owned(),
            near.b.to_owned(),
            format!("{:>9.6}", near.distance_m),
            point(near.point_a),
            point(near.point_b),
        ]);
    };
    answer.minimum.iter().for_each(|near| row("nearest", near));
    answer.minimum_capsules.iter().for_each(|near| row("nearest capsules", near));
    answer.below.iter().for_each(|near| row("below", near));
    if answer.minimum.is_some() {
        out.line(format_args!("\n{table}"))?;
    }
    for Without { link, file } in &answer.without_shape {
        out.line(format_args!("not checked: {link}: {file}"))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::own_robot;
    use super::*;

    #[test]
    fn capsules_are_never_farther_apart_than_the_shapes() {
        let model = own_robot("six_axis_arm.urdf");
        let mut builder = SceneBuilder::new();
        let mount = Mount::World(Pose::default());
        builder.add_robot("arm", &model, mount, &mut |_| None).expect("sound");
        let scene = builder.build();
        let q = [0.0, -1.2, 1.9, 0.0, 1.5, 0.0];
        let answer = measure(&model, &scene, &q, Some(10.0)).expect("positions fit");
        let exact = answer.minimum.expect("pairs").distance_m;
        let capsules = answer.minimum_capsules.expect("pairs").distance_m;
        assert!(capsules <= exact + 1e-9, "{capsules} {exact}");
        assert_eq!(answer.below.len(), answer.pairs_checked);
        assert!((answer.below[0].distance_m - exact).abs() < 1e-9);
    }

    #[test]
    fn meshes_are_looked_for_with_and_without_their_package() {
        let folder = tempfile::tempdir().expect("a directory");
        std::fs::create_dir(folder.path().join("meshes")).expect("made");
        let text = "solid x\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendsolid x\n";
        std::fs::write(folder.path().join("meshes/a.STL"), text).expect("written");
        for file in ["package://arm/meshes/a.STL", "meshes/a.STL", "file://meshes/a.STL"] {
            assert_eq!(vertices(folder.path(), file).map(|found| found.len()), Ok(3), "{file}");
        }
        let error = vertices(folder.path(), "package://arm/b.stl").expect_err("not there");
        assert!(error.contains("\"package://arm/b.stl\" is not there; looked for"), "{error}");
        std::fs::write(folder.path().join("c.dae"), "").expect("written");
        let error = vertices(folder.path(), "c.dae").expect_err("no STL");
        assert!(error.contains("is no .stl file"), "{error}");
    }
}
