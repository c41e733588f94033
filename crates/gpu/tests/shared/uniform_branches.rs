//! Branches within loops that uniforms alone decide, as naga sees them in a shader.

use std::collections::{BTreeSet, HashMap};

use naga::{Block, Expression, Function, Handle, Module, Span, Statement};

/// What a value comes from; of several the largest. A struct is one value: what its members come from is not told apart.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
enum Source {
    Constants,
    /// At least one uniform, and constants.
    Uniforms,
    /// Threads, buffers, or a branch on those.
    Threads,
}
use Source::{Constants, Threads, Uniforms};

struct Search<'a> {
    module: &'a Module,
    /// What each function returns, by its arguments, whether a loop is around the call and whether it was noted then.
    returned: HashMap<(Handle<Function>, Vec<Source>, bool, bool), Source>,
    /// Whether variables are known, so that what is found counts.
    is_noting: bool,
    /// Functions and where in the source.
    found: BTreeSet<(String, usize)>,
}

/// A function in one of its uses.
struct Scope<'a> {
    function: &'a Function,
    /// Arguments; those that are pointers stand for what they point at.
    arguments: Vec<Source>,
    locals: HashMap<Handle<naga::LocalVariable>, Source>,
    calls: HashMap<Handle<Expression>, Source>,
    returned: Source,
    /// Compilers turn all of its branches into selections.
    is_plain: bool,
}

impl Scope<'_> {
    fn source(&self, module: &Module, expression: Handle<Expression>) -> Source {
        let of = |e: Handle<Expression>| self.source(module, e);
        match self.function.expressions[expression] {
            Expression::Literal(_) | Expression::Constant(_) => Constants,
            Expression::Override(_) | Expression::ZeroValue(_) => Constants,
            Expression::Compose { ref components, .. } => {
                components.iter().map(|&e| of(e)).max().unwrap_or(Constants)
            }
            Expression::Access { base, index } => of(base).max(of(index)),
            Expression::AccessIndex { base, .. } => of(base),
            Expression::Splat { value, .. } => of(value),
            Expression::Swizzle { vector, .. } => of(vector),
            Expression::FunctionArgument(index) => self.arguments[index as usize],
            Expression::GlobalVariable(variable) => match module.global_variables[variable].space {
                naga::AddressSpace::Uniform => Uniforms,
                _ => Threads,
            },
            Expression::LocalVariable(variable) => {
                self.locals.get(&variable).copied().unwrap_or(Constants)
            }
            Expression::Load { pointer } => of(pointer),
            Expression::Unary { expr, .. } | Expression::As { expr, .. } => of(expr),
            Expression::Binary { left, right, .. } => of(left).max(of(right)),
            Expression::Select {
                condition,
                accept,
                reject,
            } => of(condition).max(of(accept)).max(of(reject)),
            Expression::Relational { argument, .. } => of(argument),
            Expression::Math {
                arg,
                arg1,
                arg2,
                arg3,
                ..
            } => {
                let arguments = [Some(arg), arg1, arg2, arg3].into_iter().flatten();
                arguments.map(of).max().unwrap_or(Constants)
            }
            Expression::CallResult(_) => self.calls.get(&expression).copied().unwrap_or(Constants),
            _ => Threads,
        }
    }

    fn note_store(&mut self, pointer: Handle<Expression>, source: Source) {
        match self.function.expressions[pointer] {
            Expression::LocalVariable(variable) => {
                let held = self.locals.entry(variable).or_insert(Constants);
                *held = source.max(*held);
            }
            Expression::FunctionArgument(index) => {
                let held = &mut self.arguments[index as usize];
                *held = source.max(*held);
            }
            Expression::Access { base, .. } | Expression::AccessIndex { base, .. } => {
                self.note_store(base, source);
            }
            _ => {}
        }
    }

    /// Whether a compiler makes the block's statements unconditional: they compute, and write variables of their own.
    /// Where the whole function does no more, it may return from its branches.
    fn is_plain(&self, block: &Block, may_return: bool) -> bool {
        block.iter().all(|statement| match statement {
            Statement::Emit(_) => true,
            Statement::Return { .. } => may_return,
            Statement::Block(inner) => self.is_plain(inner, may_return),
            Statement::If { accept, reject, .. } => {
                self.is_plain(accept, may_return) && self.is_plain(reject, may_return)
            }
            Statement::Store { pointer, .. } => self.is_own(*pointer),
            _ => false,
        })
    }

    fn is_own(&self, pointer: Handle<Expression>) -> bool {
        match self.function.expressions[pointer] {
            Expression::LocalVariable(_) | Expression::FunctionArgument(_) => true,
            Expression::Access { base, .. } | Expression::AccessIndex { base, .. } => {
                self.is_own(base)
            }
            _ => false,
        }
    }
}

impl<'a> Search<'a> {
    /// Looks through a function, everything that it calls included; what it returns.
    fn function(
        &mut self,
        function: &'a Function,
        arguments: Vec<Source>,
        is_in_loop: bool,
    ) -> Source {
        let mut scope = Scope {
            function,
            arguments,
            locals: HashMap::new(),
            calls: HashMap::new(),
            returned: Constants,
            is_plain: false,
        };
        scope.is_plain = scope.is_plain(&function.body, true);
        for (variable, local) in function.local_variables.iter() {
            let init = |e| scope.source(self.module, e);
            let source = local.init.map_or(Constants, init);
            scope.locals.insert(variable, source);
        }
        // What comes later in a loop is read earlier in its next turn: nothing counts before it all is known.
        let is_noting = std::mem::replace(&mut self.is_noting, false);
        loop {
            let known = |scope: &Scope<'_>| {
                let sources = (scope.locals.clone(), scope.arguments.clone());
                (sources, scope.calls.clone())
            };
            let before = known(&scope);
            self.block(&mut scope, &function.body, is_in_loop, Constants);
            if before == known(&scope) {
                break;
            }
        }
        self.is_noting = is_noting;
        if is_noting {
            self.block(&mut scope, &function.body, is_in_loop, Constants);
        }
        scope.returned
    }

    fn note(&mut self, scope: &Scope<'_>, span: Span) {
        if self.is_noting {
            let name = scope.function.name.clone().unwrap_or_default();
            let start = span.to_range().map_or(0, |range| range.start);
            self.found.insert((name, start));
        }
    }

    /// `control` is what the branches around the block come from.
    fn block(
        &mut self,
        scope: &mut Scope<'a>,
        block: &'a Block,
        is_in_loop: bool,
        control: Source,
    ) {
        for (statement, span) in block.span_iter() {
            match statement {
                Statement::Block(inner) => self.block(scope, inner, is_in_loop, control),
                Statement::If {
                    condition,
                    accept,
                    reject,
                } => {
                    let source = scope.source(self.module, *condition);
                    let is_plain = scope.is_plain
                        || (scope.is_plain(accept, false) && scope.is_plain(reject, false));
                    if source == Uniforms && is_in_loop && !is_plain {
                        self.note(scope, *span);
                    }
                    let control = control.max(source);
                    self.block(scope, accept, is_in_loop, control);
                    self.block(scope, reject, is_in_loop, control);
                }
                Statement::Switch { selector, cases } => {
                    let source = scope.source(self.module, *selector);
                    if source == Uniforms && is_in_loop {
                        self.note(scope, *span);
                    }
                    for case in cases {
                        self.block(scope, &case.body, is_in_loop, control.max(source));
                    }
                }
                Statement::Loop {
                    body,
                    continuing,
                    break_if,
                } => {
                    self.block(scope, body, true, control);
                    self.block(scope, continuing, true, control);
                    if break_if.is_some_and(|e| scope.source(self.module, e) == Uniforms) {
                        self.note(scope, *span);
                    }
                }
                Statement::Store { pointer, value } => {
                    let source = scope.source(self.module, *value).max(control);
                    scope.note_store(*pointer, source);
                }
                Statement::Return { value } => {
                    let source = value.map_or(Constants, |e| scope.source(self.module, e));
                    scope.returned = scope.returned.max(source).max(control);
                }
                Statement::Call {
                    function,
                    arguments,
                    result,
                } => {
                    let sources = arguments.iter().map(|&e| scope.source(self.module, e));
                    let sources: Vec<Source> = sources.collect();
                    for &argument in arguments {
                        let given = &scope.function.expressions[argument];
                        if matches!(given, Expression::LocalVariable(_)) {
                            scope.note_store(argument, Threads);
                        }
                    }
                    let key = (*function, sources.clone(), is_in_loop, self.is_noting);
                    let returned = match self.returned.get(&key) {
                        Some(&known) => known,
                        None => {
                            let called = &self.module.functions[*function];
                            let returned = self.function(called, sources, is_in_loop);
                            self.returned.insert(key, returned);
                            returned
                        }
                    };
                    if let Some(result) = result {
                        let held = scope.calls.entry(*result).or_insert(Constants);
                        *held = returned.max(control).max(*held);
                    }
                }
                _ => {}
            }
        }
    }
}

/// Lines of the shader that branch on uniforms alone within a loop, or end one so, with the function's name.
pub fn uniform_branches(module: &Module, wgsl: &str) -> Vec<String> {
    let mut search = Search {
        module,
        returned: HashMap::new(),
        is_noting: true,
        found: BTreeSet::new(),
    };
    for entry in &module.entry_points {
        let arguments = vec![Threads; entry.function.arguments.len()];
        search.function(&entry.function, arguments, false);
    }
    let line = |start: usize| wgsl[start..].lines().next().unwrap_or_default().trim();
    let found = search.found.into_iter();
    found
        .map(|(function, start)| format!("{function}: {}", line(start)))
        .collect()
}
