//! Processes that a launcher such as `mpirun` has started together.
//!
//! They share work through a store, and say nothing to each other but that it is there. With the feature `mpi` they are
//! ranks of MPI; without it, they have to be told to go on with a store that any of them makes.
//!
//! Does not know: what the work is.

#[cfg(feature = "mpi")]
use mpi::collective::Root as _;
#[cfg(feature = "mpi")]
use mpi::topology::Communicator as _;

use crate::error::Error;

/// Variables by which launchers of MPI tell how many processes they have started: Open MPI, and those of PMI.
const SIZES: [&str; 2] = ["OMPI_COMM_WORLD_SIZE", "PMI_SIZE"];

/// This process among those that were started together.
pub struct Ranks {
    /// Number of this process, from zero on.
    pub rank: usize,
    /// How many there are.
    pub size: usize,
    // Ends MPI when it is dropped.
    #[cfg(feature = "mpi")]
    universe: Option<mpi::environment::Universe>,
}

impl Ranks {
    /// Joins the others; a process that no launcher has started is alone.
    ///
    /// `resumes` says that the process goes on with a store if there is one, so that nobody has to be the first.
    ///
    /// # Errors
    /// [`Error::Options`] for several processes without the feature `mpi` of which each would make the store, and where
    /// MPI does not begin.
    pub fn join(resumes: bool) -> Result<Ranks, Error> {
        let told = SIZES.iter().find_map(|name| std::env::var(name).ok()?.parse::<usize>().ok());
        Ranks::of(told.unwrap_or(1), resumes)
    }

    #[cfg(feature = "mpi")]
    fn of(size: usize, _resumes: bool) -> Result<Ranks, Error> {
        if size == 1 {
            return Ok(Ranks { rank: 0, size, universe: None });
        }
        // One thread of each process calls MPI, others integrate and write.
        let (universe, _) = mpi::initialize_with_threading(mpi::Threading::Funneled)
            .ok_or_else(|| Error::Options { reason: "MPI was begun twice in one process".into() })?;
        let world = universe.world();
        // Ranks are counted from zero on.
        let (rank, size) = (world.rank().unsigned_abs() as usize, world.size().unsigned_abs() as usize);
        Ok(Ranks { rank, size, universe: Some(universe) })
    }

    #[cfg(not(feature = "mpi"))]
    fn of(size: usize, resumes: bool) -> Result<Ranks, Error> {
        if size == 1 || resumes {
            return Ok(Ranks { rank: 0, size: 1 });
        }
        let reason = format!(
            "{size} processes were started together, and this program was built without MPI: build it with the feature \
             mpi (cargo install hamel --features mpi), or give --resume, so that they share a store"
        );
        Err(Error::Options { reason })
    }

    /// Whether this is the process that begins what is shared.
    pub fn is_first(&self) -> bool {
        self.rank == 0
    }

    /// Tells all processes whether the first one has succeeded, once it has; `mine` counts on the first one alone.
    pub fn agree(&self, mine: bool) -> bool {
        #[cfg(feature = "mpi")]
        if let Some(universe) = &self.universe {
            let mut answer = u8::from(mine);
            universe.world().process_at_rank(0).broadcast_into(&mut answer);
            return answer == 1;
        }
        mine
    }
}
