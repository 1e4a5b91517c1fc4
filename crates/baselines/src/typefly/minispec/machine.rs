//! The MiniSpec interpreter: returns the next skill call, and continues with its result.

use std::collections::{BTreeMap, VecDeque};

use super::{Block, Call as Written, Condition, Expression, Operand, Statement, TypeError, Value};

/// Maximum number of steps of a program, so that every program ends.
const MAX_STEPS: u32 = 10_000;
/// Maximum depth of nested high-level skills.
const MAX_CALLS: usize = 8;
/// Number of calls kept in the trace.
const CALLS_KEPT: usize = 32;

/// The available skills.
pub trait Skills {
    /// Whether a word is the name or abbreviation of a skill.
    fn is_skill(&self, name: &str) -> bool;

    /// The program of a high-level skill; `None` for a low-level one, which the caller carries out.
    fn body(&self, name: &str) -> Option<Block>;
}

/// A call of a low-level skill.
#[derive(Clone, Debug, PartialEq)]
pub struct Call {
    /// The skill's name or abbreviation, as written.
    pub name: String,
    /// Its arguments.
    pub arguments: Vec<Value>,
}

/// Result of running a program.
#[derive(Clone, Debug, PartialEq)]
pub enum Progress {
    /// Carry this out, then call [`Machine::resume`].
    Skill(Call),
    /// More of the program is needed.
    Starved,
    /// The program ended with this value: that of its `->`, otherwise `None`.
    Finished(Value),
    /// The program cannot continue.
    Stopped(RuntimeError),
}

/// Why a program cannot continue.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RuntimeError {
    /// Unknown skill.
    #[error("there is no skill `{0}`")]
    UnknownSkill(String),
    /// An undefined variable.
    #[error("the variable _{0} has no value")]
    Unset(u32),
    /// A skill was called with too few arguments.
    #[error("the argument ${0} was not given")]
    NoArgument(u32),
    /// Values without an order.
    #[error(transparent)]
    Type(#[from] TypeError),
    /// Too many steps.
    #[error("the program takes more than {MAX_STEPS} steps")]
    TooManySteps,
    /// Skills are nested too deeply.
    #[error("skill calls are nested more than {MAX_CALLS} levels deep")]
    TooDeep,
}

/// What to do with the values of calls.
#[derive(Clone, Debug)]
enum Then {
    Discard,
    Assign(u32),
    Branch(Condition, Block),
}

/// The calls that a statement needs, and their results so far.
#[derive(Clone, Debug)]
struct Task {
    calls: VecDeque<Written>,
    values: VecDeque<Value>,
    then: Then,
}

#[derive(Clone, Debug)]
struct Frame {
    body: Block,
    next: usize,
    /// Remaining repetitions.
    left: u32,
}

/// The program, or the body of a skill, with its own variables.
#[derive(Clone, Debug, Default)]
struct Scope {
    variables: BTreeMap<u32, Value>,
    arguments: Vec<Value>,
    frames: Vec<Frame>,
    task: Option<Task>,
}

/// A program being run.
#[derive(Clone, Debug)]
pub struct Machine {
    /// Statements not started yet.
    queue: VecDeque<Statement>,
    /// Whether the program has arrived completely.
    complete: bool,
    scopes: Vec<Scope>,
    steps: u32,
    /// The call that the program itself is waiting for.
    called: Option<String>,
    trace: Vec<String>,
}

impl Default for Machine {
    fn default() -> Self {
        Self {
            queue: VecDeque::new(),
            complete: false,
            scopes: vec![Scope::default()],
            steps: 0,
            called: None,
            trace: Vec::new(),
        }
    }
}

impl Machine {
    /// Adds statements to the program.
    pub fn extend(&mut self, statements: Vec<Statement>) {
        self.queue.extend(statements);
    }

    /// Marks the program as complete.
    pub fn complete(&mut self) {
        self.complete = true;
    }

    /// The calls made by the program itself, with results: `goto('car_3') = True`; at most the last 32.
    #[must_use]
    pub fn trace(&self) -> &[String] {
        &self.trace
    }

    /// Runs until the next low-level skill, the end, or the end of what has arrived. Always terminates.
    pub fn advance(&mut self, skills: &dyn Skills) -> Progress {
        loop {
            self.steps += 1;
            if self.steps > MAX_STEPS {
                return Progress::Stopped(RuntimeError::TooManySteps);
            }
            match self.step(skills) {
                Ok(None) => {}
                Ok(Some(progress)) => return progress,
                Err(error) => return Progress::Stopped(error),
            }
        }
    }

    /// Passes the result of the last skill call.
    pub fn resume(&mut self, value: Value) {
        self.deliver(value);
    }

    fn step(&mut self, skills: &dyn Skills) -> Result<Option<Progress>, RuntimeError> {
        let top = self.scopes.len() - 1;
        let scope = &mut self.scopes[top];
        if let Some(task) = &mut scope.task {
            let Some(call) = task.calls.pop_front() else { return self.settle().map(|()| None) };
            let wanted = !matches!(task.then, Then::Discard);
            let arguments: Vec<Value> = call.arguments.iter().map(|operand| scope.value(operand)).collect::<Result<_, _>>()?;
            return self.call(skills, call.name, arguments, wanted);
        }
        let Some(statement) = scope.next().or_else(|| if top == 0 { self.queue.pop_front() } else { None }) else {
            return Ok(self.run_out());
        };
        self.begin(statement)
    }

    /// The current scope has ended.
    fn run_out(&mut self) -> Option<Progress> {
        if self.scopes.len() > 1 {
            self.leave(Value::None);
            return None;
        }
        Some(if self.complete { Progress::Finished(Value::None) } else { Progress::Starved })
    }

    fn call(
        &mut self,
        skills: &dyn Skills,
        name: String,
        arguments: Vec<Value>,
        wanted: bool,
    ) -> Result<Option<Progress>, RuntimeError> {
        if !skills.is_skill(&name) {
            if wanted && arguments.is_empty() {
                // A bare word that is not a skill is a string.
                self.deliver(Value::Text(name));
                return Ok(None);
            }
            return Err(RuntimeError::UnknownSkill(name));
        }
        if self.scopes.len() == 1 {
            let words: Vec<String> = arguments.iter().map(ToString::to_string).collect();
            self.called = Some(format!("{name}({})", words.join(", ")));
        }
        match skills.body(&name) {
            Some(_) if self.scopes.len() > MAX_CALLS => Err(RuntimeError::TooDeep),
            Some(body) => {
                let frames = vec![Frame { body, next: 0, left: 0 }];
                self.scopes.push(Scope { arguments, frames, ..Scope::default() });
                Ok(None)
            }
            None => Ok(Some(Progress::Skill(Call { name, arguments }))),
        }
    }

    fn begin(&mut self, statement: Statement) -> Result<Option<Progress>, RuntimeError> {
        let top = self.scopes.len() - 1;
        let scope = &mut self.scopes[top];
        let task = |calls: Vec<Written>, then| Task { calls: calls.into(), values: VecDeque::new(), then };
        match statement {
            Statement::Call(call) => scope.task = Some(task(vec![call], Then::Discard)),
            Statement::Assign { variable, value: Expression::Call(call) } => {
                scope.task = Some(task(vec![call], Then::Assign(variable)));
            }
            Statement::Assign { variable, value: Expression::Operand(operand) } => {
                let value = scope.value(&operand)?;
                scope.variables.insert(variable, value);
            }
            Statement::If { condition, body } => {
                let calls = condition.calls().cloned().collect();
                scope.task = Some(task(calls, Then::Branch(condition, body)));
            }
            Statement::Loop { count: 0, .. } => {}
            Statement::Loop { count, body } => scope.frames.push(Frame { body, next: 0, left: count - 1 }),
            Statement::Return(operand) => {
                let value = scope.value(&operand)?;
                if top == 0 {
                    return Ok(Some(Progress::Finished(value)));
                }
                self.leave(value);
            }
        }
        Ok(None)
    }

    /// All calls of a statement have results.
    fn settle(&mut self) -> Result<(), RuntimeError> {
        let top = self.scopes.len() - 1;
        let scope = &mut self.scopes[top];
        let Some(Task { mut values, then, .. }) = scope.task.take() else { return Ok(()) };
        match then {
            Then::Discard => {}
            Then::Assign(variable) => {
                scope.variables.insert(variable, values.pop_front().unwrap_or(Value::None));
            }
            Then::Branch(condition, body) => {
                if scope.holds(&condition, &mut values)? {
                    scope.frames.push(Frame { body, next: 0, left: 0 });
                }
            }
        }
        Ok(())
    }

    /// Leaves a skill with a value.
    fn leave(&mut self, value: Value) {
        self.scopes.pop();
        self.deliver(value);
    }

    /// Passes a value to the waiting statement.
    fn deliver(&mut self, value: Value) {
        if self.scopes.len() == 1
            && let Some(called) = self.called.take()
        {
            if self.trace.len() == CALLS_KEPT {
                self.trace.remove(0);
            }
            self.trace.push(format!("{called} = {value}"));
        }
        if let Some(task) = self.scopes.last_mut().and_then(|scope| scope.task.as_mut()) {
            task.values.push_back(value);
        }
    }
}

impl Scope {
    fn value(&self, operand: &Operand) -> Result<Value, RuntimeError> {
        match operand {
            Operand::Value(value) => Ok(value.clone()),
            Operand::Variable(number) => self.variables.get(number).cloned().ok_or(RuntimeError::Unset(*number)),
            Operand::Parameter(number) => {
                let found = (*number as usize).checked_sub(1).and_then(|index| self.arguments.get(index));
                found.cloned().ok_or(RuntimeError::NoArgument(*number))
            }
        }
    }

    /// The next statement of the innermost block.
    fn next(&mut self) -> Option<Statement> {
        while let Some(frame) = self.frames.last_mut() {
            if let Some(statement) = frame.body.get(frame.next) {
                frame.next += 1;
                return Some(statement.clone());
            }
            // An empty block is not repeated, since nothing in it would count steps.
            if frame.left > 0 && !frame.body.is_empty() {
                (frame.next, frame.left) = (0, frame.left - 1);
            } else {
                self.frames.pop();
            }
        }
        None
    }

    /// Evaluates a condition; `called` are the results of its calls, in order.
    fn holds(&self, condition: &Condition, called: &mut VecDeque<Value>) -> Result<bool, RuntimeError> {
        let mut side = |expression: &Expression| match expression {
            Expression::Call(_) => Ok(called.pop_front().unwrap_or(Value::None)),
            Expression::Operand(operand) => self.value(operand),
        };
        let mut groups = Vec::new();
        for group in &condition.groups {
            let mut held = Vec::new();
            for comparison in group {
                let (left, right) = (side(&comparison.left)?, side(&comparison.right)?);
                held.push(left.compare(comparison.comparator, &right)?);
            }
            let mut held = held.into_iter();
            groups.push(if condition.all_groups { held.any(|holds| holds) } else { held.all(|holds| holds) });
        }
        let mut groups = groups.into_iter();
        Ok(if condition.all_groups { groups.all(|holds| holds) } else { groups.any(|holds| holds) })
    }
}
