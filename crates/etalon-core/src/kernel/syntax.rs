//! The nodes of a WESL syntax tree in order of appearance.

use std::mem::{Discriminant, discriminant};
use std::ops::Range;

use wesl::syntax::{
    Attribute, AttributeNode, CaseSelector, CompoundStatement, Expression, ExpressionNode,
    GlobalDeclaration, GlobalDeclarationNode, LiteralExpression, Statement, StatementNode,
    TranslationUnit, TypeExpression,
};

use super::scan;

/// What a [`Node`] is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum NodeKind {
    Declaration(Discriminant<GlobalDeclaration>),
    Member,
    Attribute(Discriminant<Attribute>),
    Statement(Discriminant<Statement>),
    Expression(Discriminant<Expression>),
}

/// A part of a tree and the bytes it was parsed from.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Node {
    pub(super) kind: NodeKind,
    pub(super) span: Range<usize>,
}

impl Node {
    /// Whether this is a literal: a number, `true` or `false`.
    pub(super) fn is_literal(&self) -> bool {
        let literal = Expression::Literal(LiteralExpression::Bool(true));
        self.kind == NodeKind::Expression(discriminant(&literal))
    }
}

/// The declarations of a module without the empty ones, which are not printed.
pub(super) fn declarations(module: &TranslationUnit) -> Vec<&GlobalDeclarationNode> {
    module
        .global_declarations
        .iter()
        .filter(|declaration| !matches!(declaration.node(), GlobalDeclaration::Void))
        .collect()
}

/// The declaration and everything in it, in order of appearance.
pub(super) fn nodes(declaration: &GlobalDeclarationNode) -> Vec<Node> {
    let mut walk = Walk { nodes: Vec::new() };
    walk.declaration(declaration);
    walk.nodes
}

/// Length of the `@if(…)`, `@elif(…)` and `@else` attributes, and the blanks
/// behind them, that `text` starts with.
pub(super) fn conditions_len(text: &str) -> usize {
    let mut end = 0;
    let mut tokens = scan::tokens(text);
    loop {
        let (Some(at), Some(name)) = (tokens.next(), tokens.next()) else {
            return end;
        };
        if at.text != "@" || !matches!(name.text, "if" | "elif" | "else") {
            return end;
        }
        if name.text != "else" {
            let mut depth = 0_usize;
            for token in tokens.by_ref() {
                match token.text {
                    "(" => depth += 1,
                    ")" => depth = depth.saturating_sub(1),
                    _ => {}
                }
                if depth == 0 {
                    break;
                }
            }
        }
        end = match tokens.clone().next() {
            Some(next) => next.offset,
            None => return end,
        };
    }
}

struct Walk {
    nodes: Vec<Node>,
}

impl Walk {
    fn push(&mut self, kind: NodeKind, span: Range<usize>) {
        self.nodes.push(Node { kind, span });
    }

    fn declaration(&mut self, node: &GlobalDeclarationNode) {
        self.push(
            NodeKind::Declaration(discriminant(node.node())),
            node.span().range(),
        );
        match node.node() {
            GlobalDeclaration::Void => {}
            GlobalDeclaration::Declaration(declaration) => {
                self.attributes(&declaration.attributes);
                self.optional_type(declaration.ty.as_ref());
                self.optional(declaration.initializer.as_ref());
            }
            GlobalDeclaration::TypeAlias(alias) => {
                self.attributes(&alias.attributes);
                self.ty(&alias.ty);
            }
            GlobalDeclaration::Struct(structure) => {
                self.attributes(&structure.attributes);
                for member in &structure.members {
                    self.push(NodeKind::Member, member.span().range());
                    self.attributes(&member.attributes);
                    self.ty(&member.ty);
                }
            }
            GlobalDeclaration::Function(function) => {
                self.attributes(&function.attributes);
                for parameter in &function.parameters {
                    self.attributes(&parameter.attributes);
                    self.ty(&parameter.ty);
                }
                self.attributes(&function.return_attributes);
                self.optional_type(function.return_type.as_ref());
                self.block(&function.body);
            }
            GlobalDeclaration::ConstAssert(assertion) => {
                self.attributes(&assertion.attributes);
                self.expression(&assertion.expression);
            }
        }
    }

    fn attributes(&mut self, attributes: &[AttributeNode]) {
        for node in attributes {
            self.push(
                NodeKind::Attribute(discriminant(node.node())),
                node.span().range(),
            );
            match node.node() {
                Attribute::Align(expression)
                | Attribute::Binding(expression)
                | Attribute::BlendSrc(expression)
                | Attribute::Group(expression)
                | Attribute::Id(expression)
                | Attribute::Location(expression)
                | Attribute::Size(expression) => self.expression(expression),
                Attribute::WorkgroupSize(size) => {
                    self.expression(&size.x);
                    self.optional(size.y.as_ref());
                    self.optional(size.z.as_ref());
                }
                _ => {}
            }
        }
    }

    fn block(&mut self, block: &CompoundStatement) {
        self.attributes(&block.attributes);
        for statement in &block.statements {
            self.statement(statement);
        }
    }

    fn statement(&mut self, node: &StatementNode) {
        // Empty statements are not printed.
        if matches!(node.node(), Statement::Void) {
            return;
        }
        self.push(
            NodeKind::Statement(discriminant(node.node())),
            node.span().range(),
        );
        match node.node() {
            Statement::Void | Statement::Break(_) | Statement::Continue(_) => {}
            Statement::Discard(_) => {}
            Statement::Compound(block) => self.block(block),
            Statement::Assignment(assignment) => {
                self.expression(&assignment.lhs);
                self.expression(&assignment.rhs);
            }
            Statement::Increment(increment) => self.expression(&increment.expression),
            Statement::Decrement(decrement) => self.expression(&decrement.expression),
            Statement::If(statement) => {
                self.attributes(&statement.attributes);
                self.expression(&statement.if_clause.expression);
                self.block(&statement.if_clause.body);
                for clause in &statement.else_if_clauses {
                    self.expression(&clause.expression);
                    self.block(&clause.body);
                }
                if let Some(clause) = &statement.else_clause {
                    self.block(&clause.body);
                }
            }
            Statement::Switch(statement) => {
                self.attributes(&statement.attributes);
                self.expression(&statement.expression);
                self.attributes(&statement.body_attributes);
                for clause in &statement.clauses {
                    for selector in &clause.case_selectors {
                        if let CaseSelector::Expression(expression) = selector {
                            self.expression(expression);
                        }
                    }
                    self.block(&clause.body);
                }
            }
            Statement::Loop(statement) => {
                self.attributes(&statement.attributes);
                self.block(&statement.body);
                if let Some(continuing) = &statement.continuing {
                    self.block(&continuing.body);
                    if let Some(break_if) = &continuing.break_if {
                        self.expression(&break_if.expression);
                    }
                }
            }
            Statement::For(statement) => {
                self.attributes(&statement.attributes);
                if let Some(initializer) = &statement.initializer {
                    self.statement(initializer);
                }
                self.optional(statement.condition.as_ref());
                if let Some(update) = &statement.update {
                    self.statement(update);
                }
                self.block(&statement.body);
            }
            Statement::While(statement) => {
                self.attributes(&statement.attributes);
                // Printed with parentheses whether it has any or not.
                let mut condition = &statement.condition;
                while let Expression::Parenthesized(inner) = condition.node() {
                    condition = &inner.expression;
                }
                self.expression(condition);
                self.block(&statement.body);
            }
            Statement::Return(statement) => self.optional(statement.expression.as_ref()),
            Statement::FunctionCall(statement) => {
                self.ty(&statement.call.ty);
                for argument in &statement.call.arguments {
                    self.expression(argument);
                }
            }
            Statement::ConstAssert(assertion) => self.expression(&assertion.expression),
            Statement::Declaration(declaration) => {
                self.attributes(&declaration.attributes);
                self.optional_type(declaration.ty.as_ref());
                self.optional(declaration.initializer.as_ref());
            }
        }
    }

    fn optional(&mut self, expression: Option<&ExpressionNode>) {
        if let Some(expression) = expression {
            self.expression(expression);
        }
    }

    fn expression(&mut self, node: &ExpressionNode) {
        self.push(
            NodeKind::Expression(discriminant(node.node())),
            node.span().range(),
        );
        match node.node() {
            Expression::Literal(_) => {}
            Expression::Parenthesized(inner) => self.expression(&inner.expression),
            Expression::NamedComponent(component) => self.expression(&component.base),
            Expression::Indexing(indexing) => {
                self.expression(&indexing.base);
                self.expression(&indexing.index);
            }
            Expression::Unary(unary) => self.expression(&unary.operand),
            Expression::Binary(binary) => {
                self.expression(&binary.left);
                self.expression(&binary.right);
            }
            Expression::FunctionCall(call) => {
                self.ty(&call.ty);
                for argument in &call.arguments {
                    self.expression(argument);
                }
            }
            Expression::TypeOrIdentifier(ty) => self.ty(ty),
        }
    }

    fn optional_type(&mut self, ty: Option<&TypeExpression>) {
        if let Some(ty) = ty {
            self.ty(ty);
        }
    }

    fn ty(&mut self, ty: &TypeExpression) {
        for argument in ty.template_args.iter().flatten() {
            self.expression(&argument.expression);
        }
    }
}
