//! Robots, tools and surroundings that make a scene.

use std::collections::BTreeSet;
use std::sync::Arc;

use nalgebra::{Isometry3, Point3};

use super::body::{Body, Fitted, Owner};
use super::capsule::Capsule;
use super::error::{ClearanceError, length};
use super::scene::CollisionScene;
use crate::{Pose, RobotModel, Shape, Srdf};

/// A robot of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct RobotId(pub(super) usize);

impl RobotId {
    /// Index in the order in which the robots were added.
    #[must_use]
    pub const fn index(self) -> usize {
        self.0
    }
}

/// Where a robot's root link is fixed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mount {
    /// In the world: pose `X_WR` of the root.
    World(Pose),
    /// On a link of a robot that was added before.
    Link {
        /// That robot.
        robot: RobotId,
        /// Index among its links.
        link: usize,
        /// Pose `X_LR` of the root in the link.
        pose: Pose,
    },
}

/// A link with a mesh whose vertices are not known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MissingShape {
    /// The robot.
    pub robot: RobotId,
    /// Index among the links of its model.
    pub link: usize,
    /// The mesh's file, as the description names it.
    pub file: String,
}

/// Collects what a scene consists of.
///
/// ```
/// # use armada_model::{ClearanceError, Mount, Pose, RobotModel, SceneBuilder, Shape};
/// let arm = RobotModel::from_urdf(r#"<robot name="arm"><link name="base"/><link name="hand">
///   <collision><geometry><sphere radius="0.1"/></geometry></collision></link>
///   <joint name="lift" type="prismatic"><parent link="base"/><child link="hand"/>
///     <axis xyz="0 0 1"/><limit lower="0" upper="2" velocity="1" effort="1"/></joint></robot>"#,
///   "arm.urdf")?;
/// let mut builder = SceneBuilder::new();
/// builder.add_robot("left", &arm, Mount::World(Pose::default()), &mut |_| None)?;
/// builder.add_robot("right", &arm, Mount::World(Pose::from_translation(1.0, 0.0, 0.0)), &mut |_| None)?;
/// let scene = builder.build();
/// let mut workspace = scene.workspace();
/// let nearest = scene.place(&[0.0, 0.0], &mut workspace)?.minimum(Default::default());
/// assert!((nearest.expect("one pair").distance_m - 0.8).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct SceneBuilder {
    pub(super) robots: Vec<Robot>,
    pub(super) fixed: Vec<String>,
    pub(super) bodies: Vec<Body>,
    pub(super) allowed: BTreeSet<[Owner; 2]>,
    pub(super) missing: Vec<MissingShape>,
}

/// A robot in a scene.
#[derive(Clone, Debug)]
pub(super) struct Robot {
    pub(super) name: String,
    pub(super) model: Arc<RobotModel>,
    pub(super) mount: Mount,
    /// Pairs of links, the lower first, that its SRDF disables and enables.
    pub(super) disabled: BTreeSet<[usize; 2]>,
    pub(super) enabled: BTreeSet<[usize; 2]>,
    pub(super) unchecked: BTreeSet<usize>,
}

impl SceneBuilder {
    /// An empty scene.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a robot and a body for each `<collision>` of its links.
    ///
    /// `mesh` answers a mesh's file name with its vertices \[m\] before scaling, or `None` if it has
    /// none; such meshes are listed by [`without_shape`](CollisionScene::without_shape).
    ///
    /// # Errors
    /// [`ClearanceError::RepeatedName`] if another robot or shape has the name,
    /// [`ClearanceError::UnknownRobot`] and [`ClearanceError::UnknownLink`] if the mount is not
    /// there, [`ClearanceError::Length`] if a shape or pose is not finite or too large,
    /// [`ClearanceError::NoVertices`] if a mesh is empty.
    pub fn add_robot(
        &mut self,
        name: &str,
        model: &RobotModel,
        mount: Mount,
        mesh: &mut dyn FnMut(&str) -> Option<Vec<Point3<f64>>>,
    ) -> Result<RobotId, ClearanceError> {
        self.check_name(name)?;
        if let Mount::Link { robot, link, .. } = mount {
            self.check_link(robot, link)?;
        }
        let (Mount::World(pose) | Mount::Link { pose, .. }) = mount;
        for &value in pose.position().iter().chain(pose.isometry().rotation.coords.iter()) {
            length("mount", value)?;
        }
        let id = RobotId(self.robots.len());
        let (mut bodies, mut missing) = (Vec::new(), Vec::new());
        for (index, link) in model.links().iter().enumerate() {
            for collision in &link.collisions {
                let X_LS = collision.origin.isometry();
                let fitted = match &collision.shape {
                    Shape::Mesh { file, scale } => match mesh(file) {
                        Some(vertices) => Fitted::mesh(&vertices, *scale, X_LS)?,
                        None => {
                            let file = file.clone();
                            missing.push(MissingShape { robot: id, link: index, file });
                            continue;
                        }
                    },
                    shape => Fitted::primitive(shape, X_LS)?,
                };
                let owner = Owner::Link { robot: id, link: index };
                bodies.push(body(owner, format!("{name}/{}", link.name), fitted));
            }
        }
        self.bodies.append(&mut bodies);
        self.missing.append(&mut missing);
        self.robots.push(Robot {
            name: name.to_owned(),
            model: Arc::new(model.clone()),
            mount,
            disabled: BTreeSet::new(),
            enabled: BTreeSet::new(),
            unchecked: BTreeSet::new(),
        });
        Ok(id)
    }

    /// Takes over which pairs of the robot's links its SRDF wants checked.
    ///
    /// # Errors
    /// [`ClearanceError::UnknownRobot`] if there is no such robot.
    pub fn apply_srdf(&mut self, robot: RobotId, srdf: &Srdf) -> Result<(), ClearanceError> {
        let robots = self.robots.len();
        let unknown = ClearanceError::UnknownRobot { robot: robot.0, robots };
        let robot = self.robots.get_mut(robot.0).ok_or(unknown)?;
        robot.disabled.extend(srdf.disabled_pairs.iter().map(|pair| pair.links));
        robot.enabled.extend(&srdf.enabled_pairs);
        robot.unchecked.extend(&srdf.unchecked_links);
        Ok(())
    }

    /// Adds a capsule, given in the link, to a link: one without a shape, a tool or a payload.
    ///
    /// # Errors
    /// [`ClearanceError::UnknownRobot`] and [`ClearanceError::UnknownLink`] if there is no such
    /// link.
    pub fn add_capsule(
        &mut self,
        (robot, link): (RobotId, usize),
        name: &str,
        capsule: Capsule,
    ) -> Result<(), ClearanceError> {
        self.attach((robot, link), name, Fitted { capsule, hull: None })
    }

    /// Adds a shape at pose `X_LS` in a link: a tool or a payload.
    ///
    /// # Errors
    /// As [`add_capsule`](Self::add_capsule), [`ClearanceError::Length`] if a number is not finite
    /// or too large, [`ClearanceError::MeshFile`] if the shape is a mesh: give its capsule or
    /// convex parts.
    pub fn add_shape(
        &mut self,
        (robot, link): (RobotId, usize),
        name: &str,
        shape: &Shape,
        X_LS: &Pose,
    ) -> Result<(), ClearanceError> {
        self.attach((robot, link), name, Fitted::primitive(shape, X_LS.isometry())?)
    }

    /// Adds a shape that is fixed at pose `X_WS` in the world, such as a table.
    ///
    /// # Errors
    /// [`ClearanceError::RepeatedName`] if another robot or shape has the name,
    /// [`ClearanceError::Length`] if a number is not finite or too large,
    /// [`ClearanceError::MeshFile`] if the shape is a mesh.
    pub fn add_fixed(
        &mut self,
        name: &str,
        shape: &Shape,
        X_WS: &Pose,
    ) -> Result<Owner, ClearanceError> {
        self.check_name(name)?;
        let fitted = Fitted::primitive(shape, X_WS.isometry())?;
        let owner = Owner::Fixed { fixed: self.fixed.len() };
        self.bodies.push(body(owner, name.to_owned(), fitted));
        self.fixed.push(name.to_owned());
        Ok(owner)
    }

    /// Takes the pair out of every check: the two may touch.
    ///
    /// # Errors
    /// [`ClearanceError::UnknownRobot`], [`ClearanceError::UnknownLink`] and
    /// [`ClearanceError::UnknownFixed`] if one of them does not exist.
    pub fn allow(&mut self, a: Owner, b: Owner) -> Result<(), ClearanceError> {
        for owner in [a, b] {
            match owner {
                Owner::Link { robot, link } => self.check_link(robot, link)?,
                Owner::Fixed { fixed } if fixed < self.fixed.len() => {}
                Owner::Fixed { fixed } => {
                    let count = self.fixed.len();
                    return Err(ClearanceError::UnknownFixed { fixed, count });
                }
            }
        }
        self.allowed.insert([a.min(b), a.max(b)]);
        Ok(())
    }

    /// The scene. Which pairs it checks, [`CollisionScene`] says.
    #[must_use]
    pub fn build(self) -> CollisionScene {
        CollisionScene::new(self)
    }

    fn attach(
        &mut self,
        (robot, link): (RobotId, usize),
        name: &str,
        fitted: Fitted,
    ) -> Result<(), ClearanceError> {
        self.check_link(robot, link)?;
        let carrier = self.robots.get(robot.0).map_or("", |robot| &robot.name);
        let name = format!("{carrier}/{name}");
        self.missing.retain(|missing| (missing.robot, missing.link) != (robot, link));
        self.bodies.push(body(Owner::Link { robot, link }, name, fitted));
        Ok(())
    }

    fn check_link(&self, robot: RobotId, link: usize) -> Result<(), ClearanceError> {
        let robots = self.robots.len();
        let unknown = ClearanceError::UnknownRobot { robot: robot.0, robots };
        let robot = self.robots.get(robot.0).ok_or(unknown)?;
        let links = robot.model.links().len();
        if link < links {
            return Ok(());
        }
        Err(ClearanceError::UnknownLink { robot: robot.name.clone(), link, links })
    }

    fn check_name(&self, name: &str) -> Result<(), ClearanceError> {
        let robots = self.robots.iter().map(|robot| &robot.name);
        if robots.chain(&self.fixed).any(|taken| taken == name) {
            return Err(ClearanceError::RepeatedName { name: name.to_owned() });
        }
        Ok(())
    }
}

fn body(owner: Owner, name: String, Fitted { capsule, hull }: Fitted) -> Body {
    Body { owner, name, capsule, hull }
}

impl Mount {
    pub(super) const fn isometry(&self) -> &Isometry3<f64> {
        let (Self::World(pose) | Self::Link { pose, .. }) = self;
        pose.isometry()
    }
}
